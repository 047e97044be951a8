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
constexpr int AXES = 24;
constexpr int FINE_AXES = 48;
constexpr int BLOCK = 8;        // sequences whose memory is asked for ahead
constexpr float NEVER = 1e30f;  // more than any distance and its square
constexpr double FAR = 1e300;   // of a sequence that is out

struct FineCode {
  int8_t numbers[FINE_AXES];
  float square, tail;
};

struct PoseCodes {
  const int8_t* coarse;      // (S, AXES / 2, 64, 2)
  const float* squares;      // (S, 64)
  const uint8_t* tails;      // (S, 64)
  const float* errors;       // (S,)
  const FineCode* fine;      // (S, 64)
  const float* fine_errors;  // (S,)
};

struct PoseQuery {
  int16_t weights[AXES], fine_weights[FINE_AXES];
  float step, fine_step, tail, fine_tail, square, error, rounding;
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

template <int COUNT, class Code>
INLINE int32_t product(const Code* codes, const int16_t* weights) {
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

// Products of a sequence's coarse codes and a query's weights, one a window.
#ifdef __AVX2__
INLINE void products(const int8_t* codes, const int16_t* weights, int32_t* sums) {
  __m256i eights[WINDOWS / 8] = {};
  for (int a = 0; a < AXES; a += 2) {
    int32_t pair;
    std::memcpy(&pair, weights + a, sizeof pair);
    const __m256i both = _mm256_set1_epi32(pair);
    for (__m256i& eight : eights) {
      const __m128i sixteen = _mm_loadu_si128(reinterpret_cast<const __m128i*>(codes));
      eight = _mm256_add_epi32(eight, _mm256_madd_epi16(_mm256_cvtepi8_epi16(sixteen), both));
      codes += 16;
    }
  }
  std::memcpy(sums, eights, sizeof eights);
}
#else
INLINE void products(const int8_t* codes, const int16_t* weights, int32_t* sums) {
  std::fill(sums, sums + WINDOWS, 0);
  for (int a = 0; a < AXES; a += 2, codes += 2 * WINDOWS)
    for (int f = 0; f < WINDOWS; f++)
      sums[f] += codes[2 * f] * weights[a] + codes[2 * f + 1] * weights[a + 1];
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

  void scan(int64_t sequences, const uint64_t* words, double* near, double* far, uint64_t* frames) const {
    for (int64_t s = 0; s < sequences; s++) {
      near[s] = far[s] = FAR;
      frames[s] = 0;
      if (!words[s]) continue;
      Smallest smallest;
      each(words[s], [&](int f) __attribute__((always_inline)) { smallest.add(f, distance(s, f)); });
      smallest.store(words[s], near[s], far[s], frames[s]);
    }
  }

  void compare(int64_t sequences, const uint64_t* frames, double* near, double* far) const {
    for (int64_t begin = 0; begin < sequences; begin += BLOCK) {
      const int64_t end = std::min(begin + BLOCK, sequences);
      for (int64_t s = begin; s < end; s++) {
        if (!frames[s]) continue;
        const int f = __builtin_ctzll(frames[s]);
        prefetch(c.lengths + s * WINDOWS + f, 1);
        prefetch(code(s, f), 2 * NUMBERS * STACKED + 64);
        if (frames[s] & (frames[s] - 1)) prefetch(code(s, f + 1), 2 * NUMBERS * STACKED + 64);
      }
      for (int64_t s = begin; s < end; s++) {
        near[s] = far[s] = FAR;
        if (!frames[s]) continue;
        Bounds all{NEVER, -NEVER};
        each(frames[s], [&](int f) __attribute__((always_inline)) {
          const Bounds one = distance(s, f);
          all = {std::min(all.low, one.low), std::max(all.high, one.high)};
        });
        near[s] = all.low;
        far[s] = all.high;
      }
    }
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

// A first pass bounds all distances by the coarse codes. A second one takes the fine code of the frame that
// seems nearest, and then of those that the coarse codes cannot tell from it.
extern "C" void scan_poses(const PoseCodes* codes, const PoseQuery* query, int64_t sequences,
                           const uint64_t* words, double* near, double* far, uint64_t* frames) {
  const PoseCodes c = *codes;
  const PoseQuery q = *query;
  float dots[BLOCK][WINDOWS], lows[BLOCK][WINDOWS];
  int firsts[BLOCK];
  for (int64_t begin = 0; begin < sequences; begin += BLOCK) {
    const int64_t end = std::min(begin + BLOCK, sequences);
    for (int64_t s = begin; s < end; s++) {
      const uint64_t word = words[s];
      if (!word) continue;
      float *dot = dots[s - begin], *low = lows[s - begin], lowest = NEVER;
      int32_t sums[WINDOWS];
      products(c.coarse + s * AXES * WINDOWS, q.weights, sums);
      for (int f = 0; f < WINDOWS; f++) {
        dot[f] = q.square - sums[f] * q.step;
        low[f] = c.squares[s * WINDOWS + f] + dot[f] - (c.tails[s * WINDOWS + f] * q.tail + q.rounding);
      }
      for (int f = 0; f < WINDOWS; f++) low[f] = word >> f & 1 ? low[f] : NEVER;
      for (int f = 0; f < WINDOWS; f++) lowest = std::min(lowest, low[f]);
      firsts[s - begin] = __builtin_ctzll(at_most(low, lowest));
      prefetch(c.fine + s * WINDOWS + std::max(firsts[s - begin] - 2, 0), 5 * sizeof(FineCode));
    }
    for (int64_t s = begin; s < end; s++) {
      near[s] = far[s] = FAR;
      frames[s] = 0;
      if (!words[s]) continue;
      Smallest smallest;
      const auto look = [&](int f) __attribute__((always_inline)) {
        const FineCode& code = c.fine[s * WINDOWS + f];
        const float dot = product<FINE_AXES>(code.numbers, q.fine_weights) * q.fine_step;
        const float middle = code.square + dots[s - begin][f] - dot;
        const float spread = code.tail * q.fine_tail + q.rounding;
        smallest.add(f, roots(middle - spread, middle + spread, c.fine_errors[s] + q.error));
      };
      const int first = firsts[s - begin];
      look(first);
      const float limit = smallest.far + c.errors[s] + q.error;
      const uint64_t left = at_most(lows[s - begin], std::min(limit * limit, NEVER / 2));
      each(left & ~(uint64_t(1) << first), look);
      smallest.store(left | uint64_t(1) << first, near[s], far[s], frames[s]);
    }
  }
}

extern "C" void scan_sounds(const FrameCodes* codes, const FrameQuery* query, int64_t sequences,
                            const uint64_t* words, double* near, double* far, uint64_t* frames) {
  Sounds{*codes, *query}.scan(sequences, words, near, far, frames);
}

extern "C" void compare_sounds(const FrameCodes* codes, const FrameQuery* query, int64_t sequences,
                               const uint64_t* frames, double* near, double* far) {
  Sounds{*codes, *query}.compare(sequences, frames, near, far);
}

extern "C" void compare_poses(const FrameCodes* codes, const FrameQuery* query, int64_t sequences,
                              const uint64_t* frames, double* near, double* far) {
  Poses{*codes, *query}.compare(sequences, frames, near, far);
}

// Bounds the distances of some sequences in double precision. Of their frames, those stay that may be nearest.
extern "C" void refine(const Stream* chosen, const double* query, double* near, double* far,
                       const Stream* other, const double* other_query, double* other_near,
                       double* other_far, const int64_t* starts, const int64_t* sequences, int64_t count,
                       uint64_t* frames) {
  for (int64_t i = 0; i < count; i++) {
    const int64_t s = sequences[i];
    double distances[WINDOWS], nearest = FAR;
    each(frames[s], [&](int f) {
      distances[f] = chosen->distance(starts[s] + f, query);
      nearest = std::min(nearest, distances[f]);
    });
    const double error = ROUNDING * (1 + nearest);
    near[s] = nearest - error;
    far[s] = nearest + error;
    uint64_t left = 0;
    each(frames[s], [&](int f) { left |= uint64_t(distances[f] <= nearest + 2 * error) << f; });
    frames[s] = left;
    if (!other) continue;
    other_near[s] = FAR;
    other_far[s] = -FAR;
    each(left, [&](int f) {
      const double distance = other->distance(starts[s] + f, other_query);
      other_near[s] = std::min(other_near[s], distance - ROUNDING * (1 + distance));
      other_far[s] = std::max(other_far[s], distance + ROUNDING * (1 + distance));
    });
  }
}

// Lists the sequences that may have one of the k smallest sums of the ranks of one or two distances, and returns
// how many there are. Histograms count those that lie below another one for certain, and those that may.
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

// Marks the sequences whose bounds meet any of some intervals, which rise on both sides.
extern "C" void mark_crossing(const double* lows, const double* highs, int64_t count, const double* near,
                              const double* far, int64_t sequences, const uint64_t* frames, bool* crossed) {
  for (int64_t s = 0; s < sequences; s++) {
    if (!frames[s] || near[s] > highs[count - 1]) continue;
    const int64_t place = std::lower_bound(highs, highs + count, near[s]) - highs;
    crossed[s] |= lows[place] <= far[s];
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
