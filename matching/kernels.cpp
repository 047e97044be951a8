// The compiled search; kernels.py calls it.
//
// Compiled twice, the second time for processors with AVX2, where that exists.

#include "contest.hpp"

namespace {

// One search: bounds by the coarse codes, and where they leave the winner open by the fine ones, of the
// contenders first, then of whatever leaves the ranks of the likeliest open, and then of the others.
template <class Coarse, class CoarseOther, class Chosen, class Other>
void find(const Known& known, const uint8_t* mask, int64_t k, const Coarse& coarse,
          const CoarseOther& coarse_other, const Chosen& chosen, const Other& other, int64_t* listed,
          int64_t* counts) {
  known.scan(mask, coarse, coarse_other);
  Contest contest(known);
  counts[0] = counts[1] = 0;
  if (contest.contenders.empty()) return;
  contest.narrow(k);
  contest.refine(contest.of_contenders(), chosen, other);
  contest.narrow(k);
  contest.refine(contest.open(k), chosen, other);
  contest.narrow(k);
  contest.refine(contest.open(contest.contenders.size()), chosen, other);
  contest.narrow(k);
  contest.list(listed, counts);
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
// another one. It lists the sequences that may win, and then others whose distances are to be known; counts says
// how many may win, and how many are listed.
extern "C" void find(int64_t by_sound, int64_t sequences, const uint8_t* mask, int64_t k,
                     const PoseCodes* byte_poses, const FrameCodes* poses, const FrameCodes* byte_sounds,
                     const FrameCodes* sounds, const double* pose, const double* sound, uint64_t* frames,
                     double* near, double* far, double* other_near, double* other_far, int64_t* listed,
                     int64_t* counts) {
  const Known known{sequences, frames, {near, other_near}, {far, other_far}};
  const Poses fine_poses(*poses, pose);
  const ByteSounds coarse_sounds(*byte_sounds, sound);
  const Sounds fine_sounds(*sounds, sound);
  if (by_sound) {
    find(known, mask, k, coarse_sounds, fine_poses, fine_sounds, fine_poses, listed, counts);
  } else {
    find(known, mask, k, BytePoses(*byte_poses, pose), coarse_sounds, fine_poses, fine_sounds, listed, counts);
  }
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
