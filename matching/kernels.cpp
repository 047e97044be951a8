// The loops of the fast search; kernels.py calls them, and codes.py says what the codes are.
//
// Compiled twice, the second time for processors with AVX2, where that exists.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>
#ifdef __AVX2__
#include <immintrin.h>
#endif

#define INLINE inline __attribute__((always_inline))

namespace {

constexpr int WINDOWS = 64;
constexpr int AXES = 16, STACK = 4;  // coded axes of a pose, and poses of a feature
constexpr int AHEAD = 16;       // sequences from asking for memory to reading it
constexpr float NEVER = 1e30f;  // more than any distance and its square
constexpr double FAR = 1e300;   // of a sequence that is out

struct PoseCodes {
  const int8_t* codes;   // (S, AXES / 2, 64, 2)
  const float* squares;  // (S, 64)
  const float* errors;   // (S,)
  const float* rests;    // (S,)
};

struct PoseQuery {
  int16_t weights[AXES / 2][STACK][2];
  float step, square, error, rest, rounding;
};

struct FrameCodes {
  const int16_t* codes;  // (S, 2, n, numbers of a frame): the even frames, and the odd ones
  const float* lengths;  // (S, 64), of sounds their inverses
  const float* errors;   // (S,)
};

struct FrameQuery {
  int16_t weights[112];
  float step, square, error, rounding;
};

struct Bounds {
  float low, high;
};

template <int COUNT>
INLINE int32_t product(const int16_t* codes, const int16_t* weights) {
  int32_t sum = 0;
  for (int i = 0; i < COUNT; i++) sum += int32_t(codes[i]) * weights[i];
  return sum;
}

INLINE void prefetch(const void* begin, int bytes) {
  for (int at = 0; at < bytes; at += 64) __builtin_prefetch(static_cast<const char*>(begin) + at);
}

INLINE Bounds roots(float low, float high, float error) {
  return {std::sqrt(std::max(low, 0.f)) - error, std::sqrt(std::max(high, 0.f)) + error};
}

template <class Do>
INLINE void each(uint64_t set, Do&& act) {
  for (; set; set &= set - 1) act(__builtin_ctzll(set));
}

// The smallest of the distances of some frames, and which of them may have it. A distance that may be 0 is no
// bound from above, because the search skips it.
struct Smallest {
  float near = NEVER, far = NEVER;
  float lows[WINDOWS];

  INLINE void add(int f, Bounds distance) {
    lows[f] = distance.low;
    near = std::min(near, distance.low);
    if (distance.low > 0) far = std::min(far, distance.high);
  }

  INLINE void store(uint64_t looked_at, double& nearest, double& farthest, uint64_t& frames) const {
    uint64_t left = 0;
    each(looked_at, [&](int f) { left |= uint64_t(lows[f] <= far) << f; });
    frames = left;
    nearest = std::max(near, 0.f);
    farthest = far < NEVER ? far : FAR;
  }
};

// Products of the features of a sequence with a query, one a window. Each code is read once, and multiplied by
// its number in every pose of the query; the products of the later poses are those of later frames.
INLINE void products(const int8_t* codes, const int16_t (*weights)[STACK][2], int32_t* sums) {
  constexpr int REACH = 2 * (STACK - 1);  // the last windows of a sequence are never looked at
  int32_t poses[STACK][WINDOWS + REACH];
  for (auto& pose : poses) std::fill(pose + WINDOWS, pose + WINDOWS + REACH, 0);
#ifdef __AVX2__
  for (int f = 0; f < WINDOWS; f += 16) {
    __m256i first[STACK] = {}, second[STACK] = {};
#pragma GCC unroll 1  // all of them at once would not fit the registers
    for (int a = 0; a < AXES / 2; a++) {
      const auto* sixteen = reinterpret_cast<const __m128i*>(codes + 2 * (a * WINDOWS + f));
      const __m256i one = _mm256_cvtepi8_epi16(_mm_loadu_si128(sixteen));
      const __m256i other = _mm256_cvtepi8_epi16(_mm_loadu_si128(sixteen + 1));
      for (int o = 0; o < STACK; o++) {
        int32_t pair;
        std::memcpy(&pair, weights[a][o], sizeof pair);
        const __m256i both = _mm256_set1_epi32(pair);
        first[o] = _mm256_add_epi32(first[o], _mm256_madd_epi16(one, both));
        second[o] = _mm256_add_epi32(second[o], _mm256_madd_epi16(other, both));
      }
    }
    for (int o = 0; o < STACK; o++) {
      std::memcpy(poses[o] + f, &first[o], sizeof first[o]);
      std::memcpy(poses[o] + f + 8, &second[o], sizeof second[o]);
    }
  }
#else
  for (auto& pose : poses) std::fill(pose, pose + WINDOWS, 0);
  for (int a = 0; a < AXES / 2; a++, codes += 2 * WINDOWS)
    for (int o = 0; o < STACK; o++)
      for (int f = 0; f < WINDOWS; f++)
        poses[o][f] += codes[2 * f] * weights[a][o][0] + codes[2 * f + 1] * weights[a][o][1];
#endif
  std::copy(poses[0], poses[0] + WINDOWS, sums);
  for (int o = 1; o < STACK; o++)
    for (int f = 0; f < WINDOWS; f++) sums[f] += poses[o][f + 2 * o];
}

// The set of the numbers that are at most a limit.
#ifdef __AVX2__
INLINE uint64_t at_most(const float* numbers, float limit) {
  const __m256 most = _mm256_set1_ps(limit);
  uint64_t set = 0;
  for (int f = 0; f < WINDOWS; f += 8) {
    const __m256 in = _mm256_cmp_ps(_mm256_loadu_ps(numbers + f), most, _CMP_LE_OQ);
    set |= uint64_t(_mm256_movemask_ps(in)) << f;
  }
  return set;
}
#else
INLINE uint64_t at_most(const float* numbers, float limit) {
  uint64_t set = 0;
  for (int f = 0; f < WINDOWS; f++) set |= uint64_t(numbers[f] <= limit) << f;
  return set;
}
#endif

// The smaller of each number and, where its bit is not set, NEVER.
#ifdef __AVX2__
INLINE void leave_out(uint64_t word, float* numbers) {
  const __m256i bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
  const __m256 never = _mm256_set1_ps(NEVER);
  for (int f = 0; f < WINDOWS; f += 8) {
    const __m256i set = _mm256_and_si256(_mm256_set1_epi32(int(word >> f & 255)), bits);
    const __m256 in = _mm256_castsi256_ps(_mm256_cmpeq_epi32(set, bits));
    _mm256_storeu_ps(numbers + f, _mm256_blendv_ps(never, _mm256_loadu_ps(numbers + f), in));
  }
}
#else
INLINE void leave_out(uint64_t word, float* numbers) {
  for (int f = 0; f < WINDOWS; f++) numbers[f] = word >> f & 1 ? numbers[f] : NEVER;
}
#endif

// Poses in bytes.
struct BytePoses {
  const PoseCodes c;
  const PoseQuery q;

  // The smallest distance of a sequence, from all of its frames at once.
  INLINE void scan(int64_t s, uint64_t word, double& near, double& far, uint64_t& frames) const {
    int32_t sums[WINDOWS];
    products(c.codes + s * AXES * WINDOWS, q.weights, sums);
    float squares[WINDOWS], smallest = NEVER;
    for (int f = 0; f < WINDOWS; f++)
      squares[f] = c.squares[s * WINDOWS + f] + q.square - sums[f] * q.step;
    leave_out(word, squares);
    for (int f = 0; f < WINDOWS; f++) smallest = std::min(smallest, squares[f]);
    const float rounding = q.rounding + q.rest * c.rests[s], error = c.errors[s] + q.error;
    const Bounds bounds = roots(smallest - rounding, smallest + rounding, error);
    near = std::max(bounds.low, 0.f);
    frames = word;
    if (bounds.low <= 0) return;  // it may be 0 and skipped: any other frame may be the nearest
    far = bounds.high;
    const float limit = bounds.high + error;
    frames = at_most(squares, limit * limit + rounding);
  }
};

// Frames of pose or of sound, and how they are stacked and compared.
template <int NUMBERS, int STACKED, bool COSINE>
struct Frames {
  static constexpr int HALF = WINDOWS / 2 + STACKED - 1;
  const FrameCodes c;
  const FrameQuery q;

  INLINE const int16_t* code(int64_t s, int f) const {
    return c.codes + ((2 * s + (f & 1)) * HALF + f / 2) * NUMBERS;
  }

  INLINE Bounds distance(int64_t s, int f) const {
    const float dot = product<NUMBERS * STACKED>(code(s, f), q.weights) * q.step;
    const float length = c.lengths[s * WINDOWS + f], error = c.errors[s] + q.error;
    if (COSINE) {
      const float middle = (1 + q.square) / 2 - dot * length;
      return {middle - error - q.rounding, middle + error + q.rounding};
    }
    const float middle = length * length + q.square - 2 * dot;
    return roots(middle - q.rounding, middle + q.rounding, error);
  }

  // The smallest distance of a sequence.
  INLINE void scan(int64_t s, uint64_t word, double& near, double& far, uint64_t& frames) const {
    Smallest smallest;
    each(word, [&](int f) __attribute__((always_inline)) { smallest.add(f, distance(s, f)); });
    smallest.store(word, near, far, frames);
  }

  INLINE void ask_for(int64_t s, uint64_t frames) const {
    const int f = __builtin_ctzll(frames);
    prefetch(c.lengths + s * WINDOWS + f, 1);
    prefetch(code(s, f), 2 * NUMBERS * STACKED + 64);
    if (frames & (frames - 1)) prefetch(code(s, f + 1), 2 * NUMBERS * STACKED + 64);
  }

  // The distance of a sequence, whichever of some frames it shows.
  INLINE void compare(int64_t s, uint64_t frames, double& near, double& far) const {
    Bounds all{NEVER, -NEVER};
    each(frames, [&](int f) __attribute__((always_inline)) {
      const Bounds one = distance(s, f);
      all = {std::min(all.low, one.low), std::max(all.high, one.high)};
    });
    near = all.low;
    far = all.high;
  }
};

using Poses = Frames<24, 4, false>;
using Sounds = Frames<14, 8, true>;

}  // namespace

// Whether this processor can run the version for AVX2.
extern "C" int has_avx2() {
#ifdef __x86_64__
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2");
#else
  return 0;
#endif
}

// The frames of a sequence at which a window may begin: allowed there and at its last frame.
INLINE uint64_t eligible(const uint8_t* mask) {
  uint64_t word = 0;
  for (int byte = 0; byte < WINDOWS / 8; byte++) {
    uint64_t eight;
    std::memcpy(&eight, mask + 8 * byte, sizeof eight);
    word |= (eight * 0x0102040810204080u) >> 56 << (8 * byte);
  }
  return word & word >> 7;
}

// Bounds the smallest distance of each sequence, and lists the frames that may have it; and bounds its other
// distance, if that is asked for, whichever of these frames it is of. The memory of the second is asked for while
// the first is computed.
template <class Chosen, class Other>
INLINE void search(const Chosen& chosen, const Other* other, const uint8_t* mask, int64_t sequences,
                   uint64_t* frames, double* near, double* far, double* other_near, double* other_far) {
  for (int64_t s = 0; s < sequences + AHEAD; s++) {
    if (s < sequences) {
      near[s] = far[s] = FAR;
      frames[s] = 0;
      const uint64_t word = eligible(mask + s * WINDOWS);
      if (word) chosen.scan(s, word, near[s], far[s], frames[s]);
      if (other && frames[s]) other->ask_for(s, frames[s]);
    }
    const int64_t t = s - AHEAD;
    if (!other || t < 0) continue;
    other_near[t] = other_far[t] = FAR;
    if (frames[t]) other->compare(t, frames[t], other_near[t], other_far[t]);
  }
}

extern "C" void search_poses(const PoseCodes* codes, const PoseQuery* query, const FrameCodes* other_codes,
                             const FrameQuery* other_query, const uint8_t* mask, int64_t sequences,
                             uint64_t* frames, double* near, double* far, double* other_near,
                             double* other_far) {
  const BytePoses chosen{*codes, *query};
  const Sounds* none = nullptr;
  if (!other_codes) return search(chosen, none, mask, sequences, frames, near, far, other_near, other_far);
  const Sounds other{*other_codes, *other_query};
  search(chosen, &other, mask, sequences, frames, near, far, other_near, other_far);
}

extern "C" void search_sounds(const FrameCodes* codes, const FrameQuery* query, const FrameCodes* other_codes,
                              const FrameQuery* other_query, const uint8_t* mask, int64_t sequences,
                              uint64_t* frames, double* near, double* far, double* other_near,
                              double* other_far) {
  const Sounds chosen{*codes, *query};
  const Poses other{*other_codes, *other_query};
  search(chosen, &other, mask, sequences, frames, near, far, other_near, other_far);
}

namespace {

// The bounds of one or two distances of all sequences, and what they say about their ranks. Histograms count the
// sequences that begin below a distance, and those that end below it.
struct Bounded {
  static constexpr int BINS = 1024;
  const int64_t sequences;
  uint64_t* const frames;
  double *const near[2], *const far[2];
  const int distances = near[1] ? 2 : 1;
  double smallest[2], scale[2];
  int32_t begun[2][BINS] = {}, over[2][BINS] = {};

  Bounded(int64_t sequences, uint64_t* frames, double* near, double* far, double* other_near, double* other_far)
      : sequences(sequences), frames(frames), near{near, other_near}, far{far, other_far} {
    std::vector<int32_t> bins(sequences);
    for (int d = 0; d < distances; d++) {
      double least = FAR, largest = 0;
      for (int64_t s = 0; s < sequences; s++) {
        const double low = this->near[d][s];
        least = std::min(least, low);
        largest = std::max(largest, low < FAR ? low : 0);
      }
      smallest[d] = least;
      scale[d] = (BINS - 1) / std::max(largest - least, 1e-30);
      for (int64_t s = 0; s < sequences; s++) bins[s] = bin(d, this->near[d][s]);
      for (int64_t s = 0; s < sequences; s++) begun[d][bins[s]]++;
      for (int64_t s = 0; s < sequences; s++) bins[s] = bin(d, this->far[d][s]);
      for (int64_t s = 0; s < sequences; s++) over[d][bins[s]]++;
    }
  }

  INLINE int32_t bin(int d, double distance) const {
    return int32_t(std::min((distance - smallest[d]) * scale[d], BINS - 1.));
  }

  // Draws the bounds of a distance together.
  INLINE void draw_together(int d, int64_t s, double low, double high) {
    begun[d][bin(d, near[d][s])]--;
    over[d][bin(d, far[d][s])]--;
    near[d][s] = std::max(near[d][s], low);
    far[d][s] = std::min(far[d][s], high);
    begun[d][bin(d, near[d][s])]++;
    over[d][bin(d, far[d][s])]++;
  }

  // Keeps, of some sequences, those that may have one of the k smallest sums of ranks, the likeliest first.
  void narrow(int64_t k, std::vector<int64_t>& contenders) const {
    std::vector<int32_t> fewest(contenders.size()), most(contenders.size());
    for (int d = 0; d < distances; d++) {
      int32_t may[BINS], must[BINS];  // lie below the sequences of a bin
      for (int b = 0, begin = 0, end = 0; b < BINS; b++) {
        must[b] = end;
        may[b] = begin += begun[d][b];
        end += over[d][b];
      }
      for (size_t i = 0; i < contenders.size(); i++) {
        fewest[i] += must[bin(d, near[d][contenders[i]])];
        most[i] += may[bin(d, far[d][contenders[i]])] - 1;  // it counts the sequence itself
      }
    }
    std::vector<int32_t> best(most);
    std::nth_element(best.begin(), best.begin() + (k - 1), best.end());
    std::vector<std::pair<int32_t, int64_t>> left;
    for (size_t i = 0; i < contenders.size(); i++)
      if (fewest[i] <= best[k - 1]) left.emplace_back(most[i], contenders[i]);
    std::sort(left.begin(), left.end());
    contenders.clear();
    for (const auto& one : left) contenders.push_back(one.second);
  }

  // The bits of the distances of each sequence whose bounds meet those of a contender: that rank is open.
  std::vector<uint8_t> crossed(const int64_t* contenders, int64_t count) const {
    std::vector<uint8_t> bits(sequences);
    std::vector<double> lows(count), highs(count);
    for (int d = 0; d < distances; d++) {
      for (int64_t i = 0; i < count; i++) {
        lows[i] = near[d][contenders[i]];
        highs[i] = far[d][contenders[i]];
      }
      std::sort(lows.begin(), lows.end());
      std::sort(highs.begin(), highs.end());
      for (int64_t s = 0; s < sequences; s++) {
        if (near[d][s] > highs[count - 1] || far[d][s] < lows[0] || !frames[s]) continue;
        const int64_t place = std::lower_bound(highs.begin(), highs.end(), near[d][s]) - highs.begin();
        bits[s] |= (lows[place] <= far[d][s]) << d;
      }
    }
    return bits;
  }

  // Draws the bounds of some distances together by the finer codes of poses, and leaves the frames that stay.
  void refine(const std::vector<uint8_t>& bits, const Poses& poses, const Sounds& sounds) {
    std::vector<int64_t> list;
    for (int64_t s = 0; s < sequences; s++)
      if (bits[s]) list.push_back(s);
    const int64_t listed = list.size();
    for (int64_t i = 0; i < listed + AHEAD; i++) {
      if (i < listed) poses.ask_for(list[i], frames[list[i]]);
      if (i < listed && bits[list[i]] & 2) sounds.ask_for(list[i], frames[list[i]]);
      if (i < AHEAD) continue;
      const int64_t s = list[i - AHEAD];
      double low, high;
      if (bits[s] & 1 || frames[s] & (frames[s] - 1)) {
        poses.scan(s, frames[s], low, high, frames[s]);
        draw_together(0, s, low, high);
      }
      if (bits[s] & 2) {
        sounds.compare(s, frames[s], low, high);
        draw_together(1, s, low, high);
      }
    }
  }
};

}  // namespace

// Lists the sequences with a distance whose rank beside some contenders is open, and returns how many there are.
extern "C" int64_t list_crossing(int64_t sequences, uint64_t* frames, double* near, double* far,
                                 double* other_near, double* other_far, const int64_t* contenders,
                                 int64_t count, int64_t* crossing) {
  const Bounded bounded(sequences, frames, near, far, other_near, other_far);
  const auto bits = bounded.crossed(contenders, count);
  int64_t listed = 0;
  for (int64_t s = 0; s < sequences; s++)
    if (bits[s]) crossing[listed++] = s;
  return listed;
}

// Lists the sequences that may have one of the k smallest sums of ranks, and returns how many there are. Where
// there are finer codes, the bounds of those that may are drawn together by them, then of whatever leaves the
// ranks of the likeliest open, and then of the others.
extern "C" int64_t find_contenders(int64_t sequences, uint64_t* frames, double* near, double* far,
                                   double* other_near, double* other_far, int64_t k,
                                   const FrameCodes* pose_codes, const FrameQuery* pose_query,
                                   const FrameCodes* sound_codes, const FrameQuery* sound_query,
                                   int64_t* listed) {
  Bounded bounded(sequences, frames, near, far, other_near, other_far);
  std::vector<int64_t> contenders;
  for (int64_t s = 0; s < sequences; s++)
    if (frames[s]) contenders.push_back(s);
  bounded.narrow(k, contenders);
  if (pose_codes) {
    const Poses poses{*pose_codes, *pose_query};
    const Sounds sounds = sound_codes ? Sounds{*sound_codes, *sound_query} : Sounds{};
    std::vector<uint8_t> both(sequences);
    for (const int64_t s : contenders) both[s] = sound_codes ? 3 : 1;
    bounded.refine(both, poses, sounds);
    bounded.narrow(k, contenders);
    bounded.refine(bounded.crossed(contenders.data(), k), poses, sounds);
    bounded.narrow(k, contenders);
    bounded.refine(bounded.crossed(contenders.data(), contenders.size()), poses, sounds);
    bounded.narrow(k, contenders);
  }
  std::sort(contenders.begin(), contenders.end());
  std::copy(contenders.begin(), contenders.end(), listed);
  return contenders.size();
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
