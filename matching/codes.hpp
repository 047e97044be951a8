// Codes of features, and the bounds of distances that they give; codes.py says what the codes are.

#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#ifdef __AVX2__
#include <immintrin.h>
#endif

#define INLINE inline __attribute__((always_inline))

namespace {

constexpr int WINDOWS = 64;           // frames of a sequence, at which a window may begin
constexpr int LANES = 8, STACK = 4;   // frames that are compared at once, poses of a feature
constexpr int POSE = 24;              // numbers of a pose
constexpr int AXES = 16, PAIRS = 10;  // of a coded pose; numbers beyond AXES are finer ones of the first axes
constexpr int SHORT = 4095;           // largest whole number of a frame's query, as that of its codes
constexpr float NEVER = 1e30f;        // more than any distance and its square
constexpr double ROUNDING = 1e-5;     // of a sum in single precision, at most, as a share of its squares
constexpr double UP = 1.00001;        // factor on a bound, so that it stays one when it is rounded itself

using Shorts = int16_t __attribute__((vector_size(4 * LANES)));
using Ints = int32_t __attribute__((vector_size(4 * LANES)));
using Floats = float __attribute__((vector_size(4 * LANES)));

// Made by codes.py, in this order; AXES, PAIRS, SHORT and UP are as there.
struct PoseCodes {
  const int8_t* codes;   // (S, 2, PAIRS, 4, LANES, 2), see BytePoses
  const float* squares;  // (S, 2, 4, LANES)
  const float* errors;   // (S,)
  const float* rests;    // (S,)
  const double* axes;    // (24, AXES)
  const double* steps;   // (2 * PAIRS,)
  double greatest, longest;
};

struct FrameCodes {
  const void* codes;     // (S, frames, numbers of a frame)
  const float* lengths;  // (S, 64), of sounds their inverses
  const float* errors;   // (S,)
  double step, greatest;
};

struct Bounds {
  float low, high;
};

// Numbers as whole numbers from -largest to largest, and their step; returns the square of what they lose.
double whole(const double* numbers, int count, int largest, int16_t* codes, double& step) {
  step = 1e-9;
  for (int i = 0; i < count; i++) step = std::max(step, std::abs(numbers[i]));
  step /= largest;
  double lost = 0;
  for (int i = 0; i < count; i++) {
    codes[i] = int16_t(std::lrint(numbers[i] / step));
    lost += (numbers[i] - codes[i] * step) * (numbers[i] - codes[i] * step);
  }
  return lost;
}

INLINE Bounds roots(float low, float high, float error) {
  return {std::sqrt(std::max(low, 0.f)) - error, std::sqrt(std::max(high, 0.f)) + error};
}

template <class Do>
INLINE void each(uint64_t set, Do&& act) {
  for (; set; set &= set - 1) act(__builtin_ctzll(set));
}

// Sixteen codes as numbers; a pair of them, eight times; sums of the products of each pair of two; the numbers of
// the next lanes; the bytes of a word; the set of the bytes that are 1 and not 0.
INLINE Shorts loaded(const int16_t* codes) {
  Shorts numbers;
  std::memcpy(&numbers, codes, sizeof numbers);
  return numbers;
}
#ifdef __AVX2__
INLINE Shorts loaded(const int8_t* codes) {
  return Shorts(_mm256_cvtepi8_epi16(_mm_loadu_si128(reinterpret_cast<const __m128i*>(codes))));
}
INLINE Shorts repeated(const int16_t* pair) {
  int32_t both;
  std::memcpy(&both, pair, sizeof both);
  return Shorts(_mm256_set1_epi32(both));
}
INLINE Ints products(Shorts a, Shorts b) { return Ints(_mm256_madd_epi16(__m256i(a), __m256i(b))); }
INLINE Ints of_next_lane(Ints numbers) {
  return Ints(_mm256_permutevar8x32_epi32(__m256i(numbers), _mm256_setr_epi32(1, 2, 3, 4, 5, 6, 7, 7)));
}
INLINE Ints bytes_of(uint64_t word) { return Ints(_mm256_cvtepu8_epi32(_mm_cvtsi64_si128(int64_t(word)))); }
INLINE uint64_t set_of(const uint8_t* bytes) {
  uint64_t set = 0;
  for (int i = 0; i < WINDOWS; i += 32) {
    const __m256i some = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(bytes + i));
    set |= uint64_t(uint32_t(_mm256_movemask_epi8(_mm256_cmpgt_epi8(some, __m256i{})))) << i;
  }
  return set;
}
#else
INLINE Shorts loaded(const int8_t* codes) {
  Shorts numbers;
  for (int i = 0; i < 2 * LANES; i++) numbers[i] = codes[i];
  return numbers;
}
INLINE Shorts repeated(const int16_t* pair) {
  Shorts numbers;
  for (int i = 0; i < 2 * LANES; i++) numbers[i] = pair[i % 2];
  return numbers;
}
INLINE Ints products(Shorts a, Shorts b) {
  Ints sums;
  for (int l = 0; l < LANES; l++) sums[l] = a[2 * l] * b[2 * l] + a[2 * l + 1] * b[2 * l + 1];
  return sums;
}
INLINE Ints of_next_lane(Ints numbers) {
  Ints next;
  for (int l = 0; l < LANES; l++) next[l] = numbers[std::min(l + 1, LANES - 1)];
  return next;
}
INLINE Ints bytes_of(uint64_t word) {
  Ints bytes;
  for (int l = 0; l < LANES; l++) bytes[l] = int32_t(word >> (8 * l) & 255);
  return bytes;
}
INLINE uint64_t set_of(const uint8_t* bytes) {
  uint64_t set = 0;
  for (int i = 0; i < WINDOWS; i++) set |= uint64_t(bytes[i]) << i;
  return set;
}
#endif

// Poses in bytes. Frame 8 * lane + 2 * i + odd lies in a lane of vector i of the even or of the odd frames, so
// that those 2, 4 and 6 frames later lie in the same lane of a later vector, or in the next lane of an earlier
// one. The last windows of a sequence, which reach beyond it, are never looked at.
struct BytePoses {
  static constexpr int VECTORS = WINDOWS / LANES / 2;
  const PoseCodes c;
  int16_t weights[PAIRS][STACK][2];  // of each pair of numbers, for each of the poses stacked
  float step, square, rest, rounding;

  BytePoses(const PoseCodes& codes, const double* feature) : c(codes) {
    double wanted[STACK][2 * PAIRS], whole_square = 0, on_axes = 0, scale;
    for (int o = 0; o < STACK; o++)
      for (int n = 0; n < 2 * PAIRS; n++) {
        double number = 0;
        for (int i = 0; i < POSE; i++) number += feature[o * POSE + i] * c.axes[i * AXES + n % AXES];
        if (n < AXES) on_axes += number * number;
        wanted[o][n] = number * c.steps[n];
      }
    for (int i = 0; i < STACK * POSE; i++) whole_square += feature[i] * feature[i];
    int16_t rounded[STACK][2 * PAIRS];
    // 80 products of such a number and a byte add up to 3.3e8 at most.
    const double lost = whole(wanted[0], STACK * 2 * PAIRS, INT16_MAX, rounded[0], scale);
    for (int o = 0; o < STACK; o++)
      for (int n = 0; n < 2 * PAIRS; n++) weights[n / 2][o][n % 2] = rounded[o][n];
    step = float(2 * scale);
    square = float(whole_square);
    rest = float(2 * UP * std::sqrt(std::max(whole_square - on_axes, 0.)));
    rounding = float(ROUNDING * (c.greatest + whole_square) + 2 * c.longest * std::sqrt(lost));
  }

  static INLINE int32_t bit(int odd, int i) { return 1 << (2 * i + odd); }

  INLINE void square_distances(int64_t s, int odd, Floats* squares) const {
    Ints sums[VECTORS + STACK - 1] = {};
    const int8_t* codes = c.codes + (2 * s + odd) * PAIRS * VECTORS * LANES * 2;
#pragma GCC unroll 1  // all of them at once would not fit the registers
    for (int a = 0; a < PAIRS; a++) {
      Shorts pairs[STACK];
      for (int o = 0; o < STACK; o++) pairs[o] = repeated(weights[a][o]);
#pragma GCC unroll 4
      for (int i = 0; i < VECTORS; i++, codes += 2 * LANES) {
        const Shorts numbers = loaded(codes);
#pragma GCC unroll 4
        for (int o = 0; o < STACK; o++) sums[i - o + STACK - 1] += products(numbers, pairs[o]);
      }
    }
    for (int i = 0; i < VECTORS; i++) {
      if (i > 0) sums[i + STACK - 1] += of_next_lane(sums[i - 1]);
      Floats own;
      std::memcpy(&own, c.squares + ((2 * s + odd) * VECTORS + i) * LANES, sizeof own);
      squares[i] = own + square - __builtin_convertvector(sums[i + STACK - 1], Floats) * step;
    }
  }

  struct Measured {
    Floats squares[2 * VECTORS];
  };

  INLINE void measure(int64_t s, uint64_t word, Measured& measured) const {
    const Ints words = bytes_of(word);
#pragma GCC unroll 2
    for (int odd = 0; odd < 2; odd++) {
      Floats* squares = measured.squares + odd * VECTORS;
      square_distances(s, odd, squares);
      for (int i = 0; i < VECTORS; i++) squares[i] = (words & bit(odd, i)) != 0 ? squares[i] : NEVER;
    }
  }

  // Bounds the smallest distance of a sequence, and leaves the frames that may have it.
  INLINE void bound(int64_t s, const Measured& measured, double& near, double& far, uint64_t& frames) const {
    const Floats* squares = measured.squares;
    Floats least = squares[0];
    for (int i = 1; i < 2 * VECTORS; i++) least = squares[i] < least ? squares[i] : least;
    float smallest = NEVER;
    for (int l = 0; l < LANES; l++) smallest = std::min(smallest, least[l]);
    const float loose = rounding + rest * c.rests[s], error = c.errors[s];
    const Bounds bounds = roots(smallest - loose, smallest + loose, error);
    near = std::max(bounds.low, 0.f);
    far = NEVER;
    if (bounds.low <= 0) return;  // it may be 0 and skipped: any other frame may be the nearest
    far = bounds.high;
    const float limit = (bounds.high + error) * (bounds.high + error) + loose;
    Ints left = {};
    for (int i = 0; i < VECTORS; i++) {
      left |= (squares[i] <= limit) & bit(0, i);
      left |= (squares[VECTORS + i] <= limit) & bit(1, i);
    }
    frames = 0;
    for (int l = 0; l < LANES; l++) frames |= uint64_t(left[l]) << (8 * l);
  }
};

// Poses or sounds frame by frame, and how they are stacked and compared. Windows begin at frame 56 at the latest,
// so that what is read beyond a frame lies within the sequence.
template <class Code, int NUMBERS, int STACKED, bool COSINE>
struct Frames {
  static constexpr int COUNT = NUMBERS * STACKED;
  static constexpr int WIDTH = (NUMBERS + 2 * LANES - 1) / (2 * LANES) * (2 * LANES);  // read at once
  const FrameCodes c;
  int16_t weights[STACKED * WIDTH] = {};  // of the numbers of the next frame, 0
  float step, square, error, rounding;

  struct Measured {};

  Frames(const FrameCodes& codes, const double* feature) : c(codes) {
    double length = 0, unit[COUNT], scale, squares = 0;
    for (int i = 0; i < COUNT; i++) length += feature[i] * feature[i];
    length = COSINE ? std::max(std::sqrt(length), 1e-12) : 1;
    for (int i = 0; i < COUNT; i++) unit[i] = feature[i] / length;
    int16_t whole_unit[COUNT];
    // 112 products of two such numbers add up in 32 bits.
    const double lost = whole(unit, COUNT, SHORT, whole_unit, scale);
    for (int i = 0; i < COUNT; i++) {
      weights[i / NUMBERS * WIDTH + i % NUMBERS] = whole_unit[i];
      const double number = COSINE ? unit[i] : whole_unit[i] * scale;
      squares += number * number;
    }
    step = float(scale * c.step);
    square = float(squares);
    error = float(UP * std::sqrt(lost));
    rounding = float(ROUNDING * (COSINE ? 1 : c.greatest * c.greatest + squares));
  }

  INLINE const Code* code(int64_t s, int f) const {
    constexpr int FRAMES = WINDOWS + 2 * (STACKED - 1);
    return static_cast<const Code*>(c.codes) + (s * FRAMES + f) * NUMBERS;
  }

  INLINE Bounds distance(int64_t s, int f) const {
    const Code* codes = code(s, f);
    Ints sums = {};
    for (int o = 0; o < STACKED; o++)
      for (int i = 0; i < WIDTH; i += 2 * LANES)
        sums += products(loaded(codes + 2 * o * NUMBERS + i), loaded(weights + o * WIDTH + i));
    int32_t sum = 0;
    for (int l = 0; l < LANES; l++) sum += sums[l];
    const float dot = sum * step, length = c.lengths[s * WINDOWS + f], loose = c.errors[s] + error;
    if (COSINE) {
      const float middle = (1 + square) / 2 - dot * length;
      return {middle - loose - rounding, middle + loose + rounding};
    }
    const float middle = length * length + square - 2 * dot;
    return roots(middle - rounding, middle + rounding, loose);
  }

  INLINE void measure(int64_t, uint64_t, Measured&) const {}

  // Bounds the smallest distance of some frames of a sequence, and leaves those that may have it. What may be 0
  // is no bound from above, because the search skips it.
  INLINE void bound(int64_t s, const Measured&, double& near, double& far, uint64_t& frames) const {
    const uint64_t word = frames;
    float lows[WINDOWS], least = NEVER, most = NEVER;
    each(word, [&](int f) __attribute__((always_inline)) {
      const Bounds one = distance(s, f);
      lows[f] = one.low;
      least = std::min(least, one.low);
      if (one.low > 0) most = std::min(most, one.high);
    });
    frames = 0;
    each(word, [&](int f) { frames |= uint64_t(lows[f] <= most) << f; });
    near = std::max(least, 0.f);
    far = most;
  }

  // Bounds the distance of a sequence, whichever of some frames it shows.
  INLINE void compare(int64_t s, uint64_t frames, double& near, double& far) const {
    Bounds all{NEVER, -NEVER};
    each(frames, [&](int f) __attribute__((always_inline)) {
      const Bounds one = distance(s, f);
      all = {std::min(all.low, one.low), std::max(all.high, one.high)};
    });
    near = all.low;
    far = all.high;
  }

  // Asks for the memory of some frames, before it is read.
  INLINE void ask_for(int64_t s, uint64_t frames) const {
    const int first = __builtin_ctzll(frames);
    __builtin_prefetch(c.lengths + s * WINDOWS + first);
    const char* codes = reinterpret_cast<const char*>(code(s, first));
    constexpr int BYTES = sizeof(Code) * (2 * STACKED - 1) * NUMBERS;
    for (int byte = 0; byte < BYTES + 64; byte += 64) __builtin_prefetch(codes + byte);
  }
};

using Poses = Frames<int16_t, POSE, STACK, false>;
using Sounds = Frames<int16_t, 14, 8, true>;
using ByteSounds = Frames<int8_t, 14, 8, true>;

}  // namespace
