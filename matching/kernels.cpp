// The search in codes; kernels.py calls it, and codes.py says what the codes are.
//
// Compiled twice, the second time for processors with AVX2, where that exists.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>
#ifdef __AVX2__
#include <immintrin.h>
#endif

#define INLINE inline __attribute__((always_inline))

namespace {

constexpr int WINDOWS = 64, LANES = 8, STACK = 4;
constexpr int POSE = 24;        // numbers of a pose
constexpr int AXES = 16, PAIRS = 10;  // of a coded pose; the numbers beyond AXES are finer ones of the first axes
constexpr int BLOCK = 64;      // sequences that are bounded together
constexpr int AHEAD = 16;       // windows from asking for their memory to reading it
constexpr float NEVER = 1e30f;  // more than any distance and its square
constexpr double FAR = 1e300;   // of a sequence that is out, or may be

using Shorts = int16_t __attribute__((vector_size(4 * LANES)));
using Ints = int32_t __attribute__((vector_size(4 * LANES)));
using Floats = float __attribute__((vector_size(4 * LANES)));

// Made by codes.py, in this order.
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

// Bound of the rounding error of a sum in single precision, as a share of the squares that go into it.
constexpr double ROUNDING = 1e-5;
// Factor on a bound, so that it stays one when it is rounded itself.
constexpr double UP = 1.00001;

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
// the next lanes; the bytes of a word.
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
    int16_t codes_[STACK][2 * PAIRS];
    const double lost = whole(wanted[0], STACK * 2 * PAIRS, INT16_MAX, codes_[0], scale);
    for (int o = 0; o < STACK; o++)
      for (int n = 0; n < 2 * PAIRS; n++) weights[n / 2][o][n % 2] = codes_[o][n];
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
    const float open = rounding + rest * c.rests[s], error = c.errors[s];
    const Bounds bounds = roots(smallest - open, smallest + open, error);
    near = std::max(bounds.low, 0.f);
    far = FAR;
    if (bounds.low <= 0) return;  // it may be 0 and skipped: any other frame may be the nearest
    far = bounds.high;
    const float limit = bounds.high + error;
    Ints left = {};
    for (int i = 0; i < VECTORS; i++) left |= (squares[i] <= limit * limit + open) & bit(0, i);
    for (int i = 0; i < VECTORS; i++) left |= (squares[VECTORS + i] <= limit * limit + open) & bit(1, i);
    frames = 0;
    for (int l = 0; l < LANES; l++) frames |= uint64_t(left[l]) << (8 * l);
  }
};

// Frames of pose or of sound, and how they are stacked and compared.
// 4095 is the largest number of a query, so that 112 products of two add up in 32 bits.
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
    const double lost = whole(unit, COUNT, 4095, whole_unit, scale);
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
    far = most < NEVER ? most : FAR;
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

  INLINE void ask_for(int64_t s, uint64_t frames) const {
    const int first = __builtin_ctzll(frames);
    __builtin_prefetch(c.lengths + s * WINDOWS + first);
    const char* codes = reinterpret_cast<const char*>(code(s, first));
    constexpr int BYTES = sizeof(Code) * (2 * STACKED - 1) * NUMBERS;
    for (int byte = 0; byte < BYTES + 64; byte += 64) __builtin_prefetch(codes + byte);
  }
};

using Poses = Frames<int16_t, 24, 4, false>;
using Sounds = Frames<int16_t, 14, 8, true>;
using ByteSounds = Frames<int8_t, 14, 8, true>;

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

// What is known of the distances of all sequences, one or two each: the first chooses the frame.
struct Known {
  const int64_t sequences;
  uint64_t* const frames;  // that may be shown, as bits; none: the sequence is out
  double* const near[2];   // (S,) bounds from below
  double* const far[2];    // (S,) and from above
  const int distances = near[1] ? 2 : 1;

  // Bounds all distances. The second ones come a block later: until then their memory is on its way.
  template <class Chosen, class Other>
  void scan(const uint8_t* mask, const Chosen& chosen, const Other& other) const {
    typename Chosen::Measured measured[BLOCK];
    for (int64_t begin = 0; begin < sequences + BLOCK; begin += BLOCK) {
      const int64_t end = std::min(begin + BLOCK, sequences);
      for (int64_t s = begin; s < end; s++) {
        frames[s] = eligible(mask + s * WINDOWS);
        if (frames[s]) chosen.measure(s, frames[s], measured[s - begin]);
        if (distances > 1 && begin > 0 && frames[s - BLOCK]) other.ask_for(s - BLOCK, frames[s - BLOCK]);
      }
      for (int64_t s = begin; s < end; s++) {
        near[0][s] = far[0][s] = FAR;
        if (frames[s]) chosen.bound(s, measured[s - begin], near[0][s], far[0][s], frames[s]);
      }
      if (distances > 1 && begin > 0) compare(begin - BLOCK, std::min(begin, sequences), other);
    }
  }

  // Bounds the second distance of some sequences, whichever of their frames they show.
  template <class Other>
  void compare(int64_t begin, int64_t end, const Other& other) const {
    // They are listed first, so that the processor has no end of a short loop to guess.
    int32_t windows[BLOCK * WINDOWS], count = 0;
    float low[BLOCK], high[BLOCK];
    for (int64_t s = begin; s < end; s++) {
      low[s - begin] = NEVER;
      high[s - begin] = -NEVER;
      each(frames[s], [&](int f) { windows[count++] = (s - begin) * WINDOWS + f; });
    }
    for (int32_t i = 0; i < count; i++) {
      const int32_t s = windows[i] / WINDOWS;
      const Bounds one = other.distance(begin + s, windows[i] % WINDOWS);
      low[s] = std::min(low[s], one.low);
      high[s] = std::max(high[s], one.high);
    }
    for (int64_t s = begin; s < end; s++) {
      near[1][s] = frames[s] ? low[s - begin] : FAR;
      far[1][s] = frames[s] ? high[s - begin] : FAR;
    }
  }
};

// Who may win. Histograms count the sequences whose distance may begin in a bin, and those whose distance ends
// in it; so many may have a smaller distance than another one, and so many must.
class Contest {
 public:
  explicit Contest(const Known& known) : known(known) {
    for (int d = 0; d < known.distances; d++) {
      double largest = 0;
      least[d] = FAR;
      for (int64_t s = 0; s < known.sequences; s++) {
        const double low = known.near[d][s];
        least[d] = std::min(least[d], low);
        largest = std::max(largest, low < FAR ? low : 0);
      }
      scale[d] = (BINS - 1) / std::max(largest - least[d], 1e-30);
      first[d].resize(known.sequences);
      last[d].resize(known.sequences);
      for (int64_t s = 0; s < known.sequences; s++) first[d][s] = bin(d, known.near[d][s]);
      for (int64_t s = 0; s < known.sequences; s++) last[d][s] = bin(d, known.far[d][s]);
      for (int64_t s = 0; s < known.sequences; s++) {
        begun[d][first[d][s]]++;
        ended[d][last[d][s]]++;
      }
    }
    for (int64_t s = 0; s < known.sequences; s++)
      if (known.frames[s]) contenders.push_back(s);
  }

  // Keeps the contenders that may have one of the k smallest sums of ranks, the likeliest first.
  void narrow(int64_t k) {
    std::vector<int32_t> fewest(contenders.size()), most(contenders.size());
    for (int d = 0; d < known.distances; d++) {
      int32_t must[BINS], may[BINS];
      for (int b = 0, begins = 0, ends = 0; b < BINS; b++) {
        must[b] = ends;
        may[b] = begins += begun[d][b];
        ends += ended[d][b];
      }
      for (size_t i = 0; i < contenders.size(); i++) {
        fewest[i] += must[first[d][contenders[i]]];
        most[i] += may[last[d][contenders[i]]];
      }
    }
    // One that may be out guarantees nothing.
    for (size_t i = 0; i < contenders.size(); i++)
      if (known.far[0][contenders[i]] == FAR) most[i] = INT32_MAX;
    std::vector<int32_t> best(std::min(k, int64_t(contenders.size())));
    std::partial_sort_copy(most.begin(), most.end(), best.begin(), best.end());
    std::vector<std::pair<int32_t, int64_t>> left;
    for (size_t i = 0; i < contenders.size(); i++)
      if (best.back() == INT32_MAX || fewest[i] <= best.back() - known.distances)  // each counts itself, too
        left.emplace_back(most[i], contenders[i]);
    std::sort(left.begin(), left.end());
    contenders.clear();
    for (const auto& one : left) contenders.push_back(one.second);
  }

  // For each sequence, the bits of the distances of which the first contenders leave open who is nearer.
  std::vector<uint8_t> open(int64_t count) const {
    count = std::min(count, int64_t(contenders.size()));
    std::vector<uint8_t> bits(known.sequences);
    std::vector<double> lows(count), highs(count);
    for (int d = 0; d < known.distances; d++) {
      const double *near = known.near[d], *far = known.far[d];
      for (int64_t i = 0; i < count; i++) {
        lows[i] = near[contenders[i]];
        highs[i] = far[contenders[i]];
      }
      std::sort(lows.begin(), lows.end());
      std::sort(highs.begin(), highs.end());
      for (int64_t s = 0; s < known.sequences; s++) {
        if (near[s] > highs[count - 1] || far[s] < lows[0] || !known.frames[s]) continue;
        const int64_t place = std::lower_bound(highs.begin(), highs.end(), near[s]) - highs.begin();
        bits[s] |= (lows[place] <= far[s]) << d;
      }
    }
    return bits;
  }

  std::vector<uint8_t> of_contenders() const {
    std::vector<uint8_t> bits(known.sequences);
    for (const int64_t s : contenders) bits[s] = known.distances > 1 ? 3 : 1;
    return bits;
  }

  // Draws the bounds of some distances together by finer codes.
  template <class Chosen, class Other>
  void refine(const std::vector<uint8_t>& bits, const Chosen& chosen, const Other& other) {
    std::vector<int64_t> list;
    for (int64_t s = 0; s < known.sequences; s++)
      if (bits[s]) list.push_back(s);
    for (size_t i = 0; i < list.size() + AHEAD; i++) {
      if (i < list.size()) {
        chosen.ask_for(list[i], known.frames[list[i]]);
        if (bits[list[i]] & 2) other.ask_for(list[i], known.frames[list[i]]);
      }
      if (i < AHEAD) continue;
      const int64_t s = list[i - AHEAD];
      uint64_t& frames = known.frames[s];
      double low, high;
      if (bits[s] & 1 || frames & (frames - 1)) {
        chosen.bound(s, {}, low, high, frames);
        draw_together(0, s, low, high);
      }
      if (bits[s] & 2) {
        other.compare(s, frames, low, high);
        draw_together(1, s, low, high);
      }
    }
  }

  // Lists the contenders, and then all others whose distances are to be looked up, for their ranks or because
  // they may be out.
  void list(int64_t* listed, int64_t* counts) {
    std::sort(contenders.begin(), contenders.end());
    std::vector<uint8_t> others(known.sequences);
    if (contenders.size() > 1) others = open(contenders.size());
    for (int64_t s = 0; s < known.sequences; s++) others[s] |= known.frames[s] && known.near[0][s] == 0;
    for (const int64_t s : contenders) others[s] = 0;
    counts[0] = contenders.size();
    int64_t* end = std::copy(contenders.begin(), contenders.end(), listed);
    for (int64_t s = 0; s < known.sequences; s++)
      if (others[s]) *end++ = s;
    counts[1] = end - listed;
  }

  std::vector<int64_t> contenders;

 private:
  static constexpr int BINS = 1024;
  const Known known;
  double least[2], scale[2];
  int32_t begun[2][BINS] = {}, ended[2][BINS] = {};
  std::vector<int16_t> first[2], last[2];

  INLINE int16_t bin(int d, double distance) const {
    return int16_t(std::min((distance - least[d]) * scale[d], BINS - 1.));
  }

  void draw_together(int d, int64_t s, double low, double high) {
    double &near = known.near[d][s], &far = known.far[d][s];
    near = std::max(near, low);
    far = std::min(far, high);
    begun[d][first[d][s]]--;
    begun[d][first[d][s] = bin(d, near)]++;
    ended[d][last[d][s]]--;
    ended[d][last[d][s] = bin(d, far)]++;
  }
};

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
