// The loops of the fast search; kernels.py calls them, and codes.py says what the codes are.
//
// Compiled twice, the second time for processors with AVX2, where that exists.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#ifdef __AVX2__
#include <immintrin.h>
#endif

#define INLINE inline __attribute__((always_inline))

namespace {

constexpr int WINDOWS = 64;
constexpr int POSE = 24, STACK = 4;  // numbers of a pose, and poses of a feature
constexpr int BEHIND = 16;      // sequences from asking for memory to reading it
constexpr float NEVER = 1e30f;  // more than any distance and its square
constexpr double FAR = 1e300;   // of a sequence that is out

struct PoseCodes {
  const int8_t* codes;   // (S, POSE / 2, 64, 2)
  const float* squares;  // (S, 64)
  const float* errors;   // (S,)
};

struct PoseQuery {
  int16_t weights[STACK][POSE];
  float step, square, error, rounding;
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

// Products of the features of a sequence with a query, one a window. The codes of a pair of numbers lie side
// by side for all frames, so that a feature's later poses are the same codes, read some frames on.
#ifdef __AVX2__
INLINE void products(const int8_t* codes, const int16_t (*weights)[POSE], int32_t* sums) {
  __m256i eights[WINDOWS / 8] = {};
  for (int a = 0; a < POSE; a += 2, codes += 2 * WINDOWS)
    for (int o = 0; o < STACK; o++) {
      int32_t pair;
      std::memcpy(&pair, &weights[o][a], sizeof pair);
      const __m256i both = _mm256_set1_epi32(pair);
      for (int g = 0; g < WINDOWS / 8; g++) {
        const __m128i sixteen = _mm_loadu_si128(reinterpret_cast<const __m128i*>(codes + 16 * g + 4 * o));
        const __m256i products = _mm256_madd_epi16(_mm256_cvtepi8_epi16(sixteen), both);
        eights[g] = _mm256_add_epi32(eights[g], products);
      }
    }
  std::memcpy(sums, eights, sizeof eights);
}
#else
INLINE void products(const int8_t* codes, const int16_t (*weights)[POSE], int32_t* sums) {
  std::fill(sums, sums + WINDOWS, 0);
  for (int a = 0; a < POSE; a += 2, codes += 2 * WINDOWS)
    for (int o = 0; o < STACK; o++)
      for (int f = 0; f < WINDOWS; f++) {
        const int8_t* pair = codes + 2 * f + 4 * o;
        sums[f] += pair[0] * weights[o][a] + pair[1] * weights[o][a + 1];
      }
}
#endif

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
    products(c.codes + s * POSE * WINDOWS, q.weights, sums);
    float squares[WINDOWS], smallest = NEVER;
    for (int f = 0; f < WINDOWS; f++)
      squares[f] = c.squares[s * WINDOWS + f] + q.square - sums[f] * q.step;
    leave_out(word, squares);
    for (int f = 0; f < WINDOWS; f++) smallest = std::min(smallest, squares[f]);
    const Bounds bounds = roots(smallest - q.rounding, smallest + q.rounding, c.errors[s] + q.error);
    near = std::max(bounds.low, 0.f);
    frames = word;
    if (bounds.low <= 0) return;  // it may be 0 and skipped: any other frame may be the nearest
    far = bounds.high;
    const float limit = bounds.high + c.errors[s] + q.error;
    frames = at_most(squares, limit * limit + q.rounding);
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

// The frames of a database as they are stored, and how they are z-scored and stacked.
struct Stream {
  const float* frames;  // (N, width)
  int64_t width;
  const int64_t* columns;  // (numbers,)
  const double* means;
  const double* deviations;
  int64_t numbers, stacked;

  void ask_for(int64_t row) const { prefetch(frames + row * width, int((2 * stacked - 1) * width * 4)); }

  // Calls act(number, place) for each number of the feature that begins at a row.
  template <class Do>
  INLINE void feature(int64_t row, Do&& act) const {
    for (int64_t o = 0, place = 0; o < stacked; o++) {
      const float* frame = frames + (row + 2 * o) * width;
      for (int64_t i = 0; i < numbers; i++, place++)
        act((frame[columns[i]] - means[i]) / deviations[i], place);
    }
  }

  double euclidean(int64_t row, const double* query) const {
    double sum = 0;
    feature(row, [&](double number, int64_t place) {
      const double difference = number - query[place];
      sum += difference * difference;
    });
    return std::sqrt(sum);
  }

  double cosine(int64_t row, const double* query) const {
    double product = 0, square = 0, query_square = 0;
    feature(row, [&](double number, int64_t place) {
      product += number * query[place];
      square += number * number;
      query_square += query[place] * query[place];
    });
    const double length = std::max(std::sqrt(square), 1e-12);
    const double query_length = std::max(std::sqrt(query_square), 1e-12);
    return (square / (length * length) + query_square / (query_length * query_length)) / 2 -
           product / (length * query_length);
  }

  double distance(int64_t row, const double* query) const {
    return numbers == 24 ? euclidean(row, query) : cosine(row, query);
  }
};

constexpr double ROUNDING = 1e-9;  // more than double precision loses

}  // namespace

// Whether this processor can run the version for AVX2.
extern "C" int has_avx2() {
#ifdef __x86_64__
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2");
#else
  return 0;
#endif
}

// The frames of each sequence at which a window may begin: allowed there and at its last frame.
extern "C" void eligible_words(const uint8_t* mask, int64_t sequences, uint64_t* words) {
  for (int64_t s = 0; s < sequences; s++) {
    uint64_t word = 0;
    for (int byte = 0; byte < WINDOWS / 8; byte++) {
      uint64_t eight;
      std::memcpy(&eight, mask + s * WINDOWS + 8 * byte, sizeof eight);
      word |= (eight * 0x0102040810204080u) >> 56 << (8 * byte);
    }
    words[s] = word & word >> 7;
  }
}

// Bounds the smallest distance of each sequence, and lists the frames that may have it; and bounds its other
// distance, if that is asked for, whichever of these frames it is of. The memory of the second is asked for while
// the first is computed.
template <class Chosen, class Other>
INLINE void search(const Chosen& chosen, const Other* other, int64_t sequences, const uint64_t* words,
                   double* near, double* far, uint64_t* frames, double* other_near, double* other_far) {
  for (int64_t s = 0; s < sequences + BEHIND; s++) {
    if (s < sequences) {
      near[s] = far[s] = FAR;
      frames[s] = 0;
      if (words[s]) chosen.scan(s, words[s], near[s], far[s], frames[s]);
      if (other && frames[s]) other->ask_for(s, frames[s]);
    }
    const int64_t t = s - BEHIND;
    if (!other || t < 0) continue;
    other_near[t] = other_far[t] = FAR;
    if (frames[t]) other->compare(t, frames[t], other_near[t], other_far[t]);
  }
}

extern "C" void search_poses(const PoseCodes* codes, const PoseQuery* query, const FrameCodes* other_codes,
                             const FrameQuery* other_query, int64_t sequences, const uint64_t* words,
                             double* near, double* far, uint64_t* frames, double* other_near,
                             double* other_far) {
  const BytePoses chosen{*codes, *query};
  const Sounds* none = nullptr;
  if (!other_codes) return search(chosen, none, sequences, words, near, far, frames, other_near, other_far);
  const Sounds other{*other_codes, *other_query};
  search(chosen, &other, sequences, words, near, far, frames, other_near, other_far);
}

extern "C" void search_sounds(const FrameCodes* codes, const FrameQuery* query, const FrameCodes* other_codes,
                              const FrameQuery* other_query, int64_t sequences, const uint64_t* words,
                              double* near, double* far, uint64_t* frames, double* other_near,
                              double* other_far) {
  const Sounds chosen{*codes, *query};
  const Poses other{*other_codes, *other_query};
  search(chosen, &other, sequences, words, near, far, frames, other_near, other_far);
}

// Bounds distances of some sequences in double precision: of their frames, those stay that may be nearest.
// What is wanted of a sequence are CHOSEN distances, by which frames are chosen, OTHER ones, or both.
extern "C" void refine(const Stream* chosen, const double* query, double* near, double* far,
                       const Stream* other, const double* other_query, double* other_near,
                       double* other_far, const int64_t* starts, const int64_t* sequences, int64_t count,
                       const uint8_t* wanted, uint64_t* frames) {
  constexpr int CHOSEN = 1, OTHER = 2, AHEAD = 3;
  const auto bound = [](double distance) { return ROUNDING * (1 + distance); };
  for (int64_t i = 0; i < count; i++) {
    if (i + AHEAD < count) {
      const int64_t s = sequences[i + AHEAD], row = starts[s] + __builtin_ctzll(frames[s]);
      if (wanted[s] & CHOSEN) chosen->ask_for(row);
      if (wanted[s] & OTHER) other->ask_for(row);
    }
    const int64_t s = sequences[i];
    if (wanted[s] & CHOSEN || frames[s] & (frames[s] - 1)) {
      double distances[WINDOWS], nearest = FAR;
      each(frames[s], [&](int f) {
        distances[f] = chosen->distance(starts[s] + f, query);
        nearest = std::min(nearest, distances[f]);
      });
      near[s] = nearest - bound(nearest);
      far[s] = nearest + bound(nearest);
      uint64_t left = 0;
      each(frames[s], [&](int f) { left |= uint64_t(distances[f] <= nearest + 2 * bound(nearest)) << f; });
      frames[s] = left;
    }
    if (wanted[s] & OTHER) {
      other_near[s] = FAR;
      other_far[s] = -FAR;
      each(frames[s], [&](int f) {
        const double distance = other->distance(starts[s] + f, other_query);
        other_near[s] = std::min(other_near[s], distance - bound(distance));
        other_far[s] = std::max(other_far[s], distance + bound(distance));
      });
    }
  }
}

// Lists the sequences that may have one of the k smallest sums of the ranks of one or two distances, and
// returns how many there are. Histograms count those that lie below another one for certain, or may.
extern "C" int64_t list_contenders(int64_t k, int64_t sequences, const uint64_t* frames, const double* near,
                                   const double* far, const double* other_near, const double* other_far,
                                   int32_t* fewest, int64_t* contenders) {
  constexpr int BINS = 1024;
  std::fill(fewest, fewest + 2 * sequences, 0);
  int32_t* most = fewest + sequences;
  for (int turn = 0; turn < (other_near ? 2 : 1); turn++) {
    const double* low = turn ? other_near : near;
    const double* high = turn ? other_far : far;
    double smallest = FAR, largest = -FAR;
    for (int64_t s = 0; s < sequences; s++) {
      if (!frames[s]) continue;
      smallest = std::min(smallest, low[s]);
      largest = std::max(largest, low[s]);
    }
    const double scale = (BINS - 1) / std::max(largest - smallest, 1e-30);
    const auto bin = [=](double distance) {
      return int(std::min((distance - smallest) * scale, BINS - 1.));
    };
    int32_t begun[BINS] = {}, over[BINS + 1] = {};
    for (int64_t s = 0; s < sequences; s++) {
      if (!frames[s]) continue;
      begun[bin(low[s])]++;
      over[bin(high[s]) + 1]++;
    }
    for (int b = 1; b < BINS; b++) {
      begun[b] += begun[b - 1];
      over[b] += over[b - 1];
    }
    for (int64_t s = 0; s < sequences; s++) {
      if (!frames[s]) continue;
      fewest[s] += over[bin(low[s])];
      most[s] += begun[bin(high[s])];
    }
  }

  int32_t best[16];  // the k smallest of `most`, in rising order
  std::fill(best, best + k, INT32_MAX);
  for (int64_t s = 0; s < sequences; s++) {
    if (!frames[s] || most[s] >= best[k - 1]) continue;
    int place = int(k) - 1;
    for (; place > 0 && best[place - 1] > most[s]; place--) best[place] = best[place - 1];
    best[place] = most[s];
  }
  // `most` counts a sequence itself once for each distance.
  const int32_t limit = best[k - 1] - (other_near ? 2 : 1);
  int64_t count = 0;
  for (int64_t s = 0; s < sequences; s++)
    if (frames[s] && fewest[s] <= limit) contenders[count++] = s;
  return count;
}

// Sets a bit of the sequences whose bounds meet any of some intervals, which rise on both sides.
extern "C" void mark_crossing(const double* lows, const double* highs, int64_t count, const double* near,
                              const double* far, int64_t sequences, const uint64_t* frames, int64_t bit,
                              uint8_t* crossed) {
  for (int64_t s = 0; s < sequences; s++) {
    if (!frames[s] || near[s] > highs[count - 1]) continue;
    const int64_t place = std::lower_bound(highs, highs + count, near[s]) - highs;
    if (lows[place] <= far[s]) crossed[s] |= bit;
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
