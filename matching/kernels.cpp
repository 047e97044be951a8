// The compiled search; kernels.py calls it.
//
// Compiled twice, the second time for processors with AVX2, where that exists.

#include <algorithm>
#include <cstdint>
#include <vector>

#include "contest.hpp"

namespace {

// One search: bounds by the coarse codes, and where they leave the winner open by the fine ones, of the
// contenders first, then of whatever leaves the ranks of the likeliest open, and then of the others. Lists the
// contenders that are left, in their order, and then all others that may be out; returns how many contenders there are.
template <class Coarse, class CoarseOther, class Chosen, class Other>
int64_t find(const Known& known, const uint8_t* mask, int64_t k, const Coarse& coarse,
             const CoarseOther& coarse_other, const Chosen& chosen, const Other& other, int64_t* listed,
             int64_t* count) {
  known.scan(mask, coarse, coarse_other);
  Contest contest(known);
  const std::vector<int64_t>& contenders = contest.contenders;
  const auto undecided = [&](int64_t first) {
    return known.undecided(contenders.data(), std::min(first, int64_t(contenders.size())));
  };
  if (!contenders.empty()) {
    contest.narrow(k);
    contest.refine(contest.of_contenders(), chosen, other);
    contest.narrow(k);
    contest.refine(undecided(k), chosen, other);
    contest.narrow(k);
    contest.refine(undecided(known.sequences), chosen, other);
    contest.narrow(k);
  }
  std::vector<uint8_t> left(known.sequences);
  for (int64_t s = 0; s < known.sequences; s++) left[s] = known.frames[s] && known.may_be_out(s);
  for (const int64_t s : contenders) left[s] = 0;
  int64_t* end = std::copy(contenders.begin(), contenders.end(), listed);
  std::sort(listed, end);
  for (int64_t s = 0; s < known.sequences; s++)
    if (left[s]) *end++ = s;
  *count = end - listed;
  return contenders.size();
}

}  // namespace

// Whether this processor can run the version for AVX2.
extern "C" int has_avx2() {
#ifdef __x86_64__
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2");
#else
  return 0;
#endif
}

// A search with the frames chosen by pose, or by sound, and with one distance alone where there are no bounds for
// another one. Lists the sequences that may win, then those that may be out, and returns how many may win.
extern "C" int64_t find(int64_t sequences, uint64_t* frames, double* near, double* far, double* other_near,
                        double* other_far, int64_t by_sound, const uint8_t* mask, int64_t k,
                        const PoseCodes* byte_poses, const FrameCodes* poses, const FrameCodes* byte_sounds,
                        const FrameCodes* sounds, const double* pose, const double* sound, int64_t* listed,
                        int64_t* count) {
  const Known known{sequences, frames, {near, other_near}, {far, other_far}};
  const Poses fine_poses(*poses, pose);
  const ByteSounds coarse_sounds(*byte_sounds, sound);
  const Sounds fine_sounds(*sounds, sound);
  if (by_sound) return find(known, mask, k, coarse_sounds, fine_poses, fine_sounds, fine_poses, listed, count);
  return find(known, mask, k, BytePoses(*byte_poses, pose), coarse_sounds, fine_poses, fine_sounds, listed, count);
}

// Lists the sequences that leave a rank of some contenders open, themselves among them, and returns how many.
extern "C" int64_t list_undecided(int64_t sequences, uint64_t* frames, double* near, double* far,
                                  double* other_near, double* other_far, const int64_t* contenders,
                                  int64_t count, int64_t* listed) {
  const Known known{sequences, frames, {near, other_near}, {far, other_far}};
  const std::vector<uint8_t> bits = known.undecided(contenders, count);
  int64_t* end = listed;
  for (int64_t s = 0; s < sequences; s++)
    if (bits[s]) *end++ = s;
  return end - listed;
}

// Counts, for each of some known distances in rising order, those between the one before and it. Ties are in
// the order of the sequences.
extern "C" void count_before(const double* distances, const int64_t* owners, int64_t count, const double* far,
                             int64_t sequences, const uint64_t* frames, int64_t* before) {
  const double* end = distances + count;
  for (int64_t s = 0; s < sequences; s++) {
    if (!frames[s] || far[s] > end[-1]) continue;
    int64_t place = std::lower_bound(distances, end, far[s]) - distances;
    while (place < count && distances[place] == far[s] && owners[place] <= s) place++;
    if (place < count) before[place]++;
  }
}
