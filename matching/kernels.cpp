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
constexpr int PAIRS = 10;       // of coded numbers of a pose
constexpr int AHEAD = 16;       // sequences from asking for memory to reading it
constexpr float NEVER = 1e30f;  // more than any distance and its square
constexpr double FAR = 1e300;   // of a sequence that is out, or may be

using Ints = int32_t __attribute__((vector_size(4 * LANES)));
using Floats = float __attribute__((vector_size(4 * LANES)));

struct PoseCodes {
  const int8_t* codes;   // (S, 2, PAIRS, 4, LANES, 2), see BytePoses
  const float* squares;  // (S, 2, 4, LANES)
  const float* errors;   // (S,)
  const float* rests;    // (S,)
};

struct PoseQuery {
  int16_t weights[PAIRS][STACK][2];
  float step, square, rest, rounding;
};

struct FrameCodes {
  const void* codes;     // (S, 2, n, numbers of a frame): the even frames, and the odd ones
  const float* lengths;  // (S, 64), of sounds their inverses
  const float* errors;   // (S,)
  float step, rounding;
};

struct FrameQuery {
  int16_t weights[112];
  float step, square, error, rounding;
};

struct Bounds {
  float low, high;
};

INLINE Bounds roots(float low, float high, float error) {
  return {std::sqrt(std::max(low, 0.f)) - error, std::sqrt(std::max(high, 0.f)) + error};
}

INLINE void prefetch(const void* begin, int bytes) {
  for (int at = 0; at < bytes; at += 64) __builtin_prefetch(static_cast<const char*>(begin) + at);
}

template <class Do>
INLINE void each(uint64_t set, Do&& act) {
  for (; set; set &= set - 1) act(__builtin_ctzll(set));
}

// Pairs of codes of eight frames times a pair of weights; the numbers of the next lanes; the bytes of a word.
#ifdef __AVX2__
INLINE Ints multiplied(const int8_t* codes, const int16_t* weights) {
  int32_t pair;
  std::memcpy(&pair, weights, sizeof pair);
  const __m256i numbers = _mm256_cvtepi8_epi16(_mm_loadu_si128(reinterpret_cast<const __m128i*>(codes)));
  return Ints(_mm256_madd_epi16(numbers, _mm256_set1_epi32(pair)));
}
INLINE Ints of_next_lane(Ints numbers) {
  return Ints(_mm256_permutevar8x32_epi32(__m256i(numbers), _mm256_setr_epi32(1, 2, 3, 4, 5, 6, 7, 7)));
}
INLINE Ints bytes_of(uint64_t word) { return Ints(_mm256_cvtepu8_epi32(_mm_cvtsi64_si128(int64_t(word)))); }
#else
INLINE Ints multiplied(const int8_t* codes, const int16_t* weights) {
  Ints products;
  for (int l = 0; l < LANES; l++) products[l] = codes[2 * l] * weights[0] + codes[2 * l + 1] * weights[1];
  return products;
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
  const PoseQuery q;

  static INLINE int32_t bit(int odd, int i) { return 1 << (2 * i + odd); }

  INLINE void square_distances(int64_t s, int odd, Floats* squares) const {
    Ints sums[VECTORS + STACK - 1] = {};
    const int8_t* codes = c.codes + (2 * s + odd) * PAIRS * VECTORS * LANES * 2;
#pragma GCC unroll 1  // all of them at once would not fit the registers
    for (int a = 0; a < PAIRS; a++)
      for (int i = 0; i < VECTORS; i++, codes += 2 * LANES)
        for (int o = 0; o < STACK; o++) sums[i - o + STACK - 1] += multiplied(codes, q.weights[a][o]);
    for (int i = 0; i < VECTORS; i++) {
      if (i > 0) sums[i + STACK - 1] += of_next_lane(sums[i - 1]);
      Floats own;
      std::memcpy(&own, c.squares + ((2 * s + odd) * VECTORS + i) * LANES, sizeof own);
      squares[i] = own + q.square - __builtin_convertvector(sums[i + STACK - 1], Floats) * q.step;
    }
  }

  // Bounds the smallest distance of a sequence, and finds the frames that may have it.
  INLINE void scan(int64_t s, uint64_t word, double& near, double& far, uint64_t& frames) const {
    const Ints words = bytes_of(word);
    Floats squares[2][VECTORS], least = Floats{} + NEVER;
    for (int odd = 0; odd < 2; odd++) {
      square_distances(s, odd, squares[odd]);
      for (int i = 0; i < VECTORS; i++) {
        squares[odd][i] = (words & bit(odd, i)) != 0 ? squares[odd][i] : NEVER;
        least = squares[odd][i] < least ? squares[odd][i] : least;
      }
    }
    float smallest = NEVER;
    for (int l = 0; l < LANES; l++) smallest = std::min(smallest, least[l]);

    const float rounding = q.rounding + q.rest * c.rests[s], error = c.errors[s];
    const Bounds bounds = roots(smallest - rounding, smallest + rounding, error);
    frames = word;
    near = std::max(bounds.low, 0.f);
    far = FAR;
    if (bounds.low <= 0) return;  // it may be 0 and skipped: any other frame may be the nearest
    far = bounds.high;
    const float limit = bounds.high + error;
    Ints left = {};
    for (int odd = 0; odd < 2; odd++)
      for (int i = 0; i < VECTORS; i++)
        left |= (squares[odd][i] <= limit * limit + rounding) & bit(odd, i);
    frames = 0;
    for (int l = 0; l < LANES; l++) frames |= uint64_t(left[l]) << (8 * l);
  }
};

// Frames of pose or of sound, and how they are stacked and compared.
template <class Code, int NUMBERS, int STACKED, bool COSINE>
struct Frames {
  static constexpr int HALF = WINDOWS / 2 + STACKED - 1, COUNT = NUMBERS * STACKED;
  const FrameCodes c;
  const FrameQuery q;

  INLINE const Code* code(int64_t s, int f) const {
    return static_cast<const Code*>(c.codes) + ((2 * s + (f & 1)) * HALF + f / 2) * NUMBERS;
  }

  INLINE Bounds distance(int64_t s, int f) const {
    const Code* codes = code(s, f);
    int32_t sum = 0;
    for (int i = 0; i < COUNT; i++) sum += int32_t(codes[i]) * q.weights[i];
    const float dot = sum * (q.step * c.step), length = c.lengths[s * WINDOWS + f];
    const float error = c.errors[s] + q.error, rounding = c.rounding + q.rounding;
    if (COSINE) {
      const float middle = (1 + q.square) / 2 - dot * length;
      return {middle - error - rounding, middle + error + rounding};
    }
    const float middle = length * length + q.square - 2 * dot;
    return roots(middle - rounding, middle + rounding, error);
  }

  // Bounds the smallest distance of some frames of a sequence, and leaves those that may have it. What may be 0
  // is no bound from above, because the search skips it.
  INLINE void scan(int64_t s, uint64_t word, double& near, double& far, uint64_t& frames) const {
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
    const int f = __builtin_ctzll(frames);
    prefetch(c.lengths + s * WINDOWS + f, 1);
    prefetch(code(s, f), sizeof(Code) * COUNT + 64);
    if (frames & (frames - 1)) prefetch(code(s, f + 1), sizeof(Code) * COUNT + 64);
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

  // Bounds all distances. The memory of the second one is asked for while the first is computed.
  template <class Chosen, class Other>
  void scan(const uint8_t* mask, const Chosen& chosen, const Other& other) const {
    for (int64_t s = 0; s < sequences + AHEAD; s++) {
      if (s < sequences) {
        near[0][s] = far[0][s] = FAR;
        frames[s] = 0;
        const uint64_t word = eligible(mask + s * WINDOWS);
        if (word) chosen.scan(s, word, near[0][s], far[0][s], frames[s]);
        if (distances > 1 && frames[s]) other.ask_for(s, frames[s]);
      }
      const int64_t t = s - AHEAD;
      if (distances < 2 || t < 0) continue;
      near[1][t] = far[1][t] = FAR;
      if (frames[t]) other.compare(t, frames[t], near[1][t], far[1][t]);
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
        chosen.scan(s, frames, low, high, frames);
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

template <class Compared, class Codes, class Query>
INLINE Compared compared(const void* const* codes_and_query) {
  return {*static_cast<const Codes*>(codes_and_query[0]), *static_cast<const Query*>(codes_and_query[1])};
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

// A search with the frames chosen by pose, or by sound. Codes, each with its query: of poses in bytes, of poses,
// of sounds in bytes, of sounds. Without a second distance there is one alone.
//
// It lists the sequences that may win, and then others whose distances are to be known; counts says how many
// may win, and how many are listed.
extern "C" void find(int64_t by_sound, int64_t sequences, const uint8_t* mask, int64_t k,
                     const void* const* codes, uint64_t* frames, double* near, double* far, double* other_near,
                     double* other_far, int64_t* listed, int64_t* counts) {
  const Known known{sequences, frames, {near, other_near}, {far, other_far}};
  const auto poses = compared<Poses, FrameCodes, FrameQuery>(codes + 2);
  const auto byte_sounds = compared<ByteSounds, FrameCodes, FrameQuery>(codes + 4);
  const auto sounds = compared<Sounds, FrameCodes, FrameQuery>(codes + 6);
  if (by_sound) return find(known, mask, k, byte_sounds, poses, sounds, poses, listed, counts);
  const auto byte_poses = compared<BytePoses, PoseCodes, PoseQuery>(codes);
  find(known, mask, k, byte_poses, byte_sounds, poses, sounds, listed, counts);
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
