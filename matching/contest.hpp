// Who wins a search: bounds of distances bound ranks.

#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "codes.hpp"

namespace {

constexpr int BLOCK = 64;  // sequences that are bounded together
constexpr int AHEAD = 16;  // sequences from asking for their memory to reading it

// The frames of a sequence at which a window may begin: allowed there and at its last frame.
INLINE uint64_t eligible(const uint8_t* mask) {
  const uint64_t word = set_of(mask);
  return word & word >> 7;
}

// What is known of the distances of all sequences, one or two each: the first chooses the frame. A sequence without
// a frame is out. One whose first distance has no bound from above but NEVER may be out: its frames may all be the
// query's own, which are skipped.
struct Known {
  const int64_t sequences;
  uint64_t* const frames;  // that may be shown, as bits
  double* const near[2];   // (S,) bounds from below
  double* const far[2];    // (S,) and from above
  const int distances = near[1] ? 2 : 1;

  bool may_be_out(int64_t s) const { return far[0][s] == NEVER; }

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
        near[0][s] = far[0][s] = NEVER;
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
      const int32_t place = windows[i] / WINDOWS;
      const Bounds one = other.distance(begin + place, windows[i] % WINDOWS);
      low[place] = std::min(low[place], one.low);
      high[place] = std::max(high[place], one.high);
    }
    for (int64_t s = begin; s < end; s++) {
      near[1][s] = low[s - begin];
      far[1][s] = may_be_out(s) ? NEVER : high[s - begin];
    }
  }

  // For each sequence, the bits of the distances of which some contenders leave open who is nearer.
  std::vector<uint8_t> undecided(const int64_t* contenders, int64_t count) const {
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
        // Of the contenders, those that begin before the sequence ends are more than those that end before it
        // begins: some overlap it.
        const int64_t ended = std::lower_bound(highs.begin(), highs.end(), near[d][s]) - highs.begin();
        bits[s] |= (lows[ended] <= far[d][s]) << d;
      }
    }
    return bits;
  }
};

// Who may win. Histograms count the sequences whose distance may begin in a bin, and those whose distance ends
// in it; so many may have a smaller distance than another one, and so many must.
class Contest {
 public:
  explicit Contest(const Known& known) : known(known) {
    for (int d = 0; d < known.distances; d++) {
      double largest = 0;
      least[d] = NEVER;
      for (int64_t s = 0; s < known.sequences; s++) {
        const double low = known.near[d][s];
        least[d] = std::min(least[d], low);
        largest = std::max(largest, low < NEVER ? low : 0);
      }
      scale[d] = (BINS - 1) / std::max(largest - least[d], 1e-6);
      first_bin[d].resize(known.sequences);
      last_bin[d].resize(known.sequences);
      for (int64_t s = 0; s < known.sequences; s++) first_bin[d][s] = bin(d, known.near[d][s]);
      for (int64_t s = 0; s < known.sequences; s++) last_bin[d][s] = bin(d, known.far[d][s]);
      for (int64_t s = 0; s < known.sequences; s++) {
        begun[d][first_bin[d][s]]++;
        ended[d][last_bin[d][s]]++;
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
        fewest[i] += must[first_bin[d][contenders[i]]];
        most[i] += may[last_bin[d][contenders[i]]];
      }
    }
    for (size_t i = 0; i < contenders.size(); i++)
      if (known.may_be_out(contenders[i])) most[i] = INT32_MAX;
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
      if (bits[s] & 1 || frames & (frames - 1)) {  // with fewer frames, the other distance varies less
        chosen.bound(s, {}, low, high, frames);
        draw_together(0, s, low, high);
      }
      if (bits[s] & 2) {
        other.compare(s, frames, low, high);
        draw_together(1, s, low, known.may_be_out(s) ? NEVER : high);
      }
    }
  }

  std::vector<int64_t> contenders;

 private:
  static constexpr int BINS = 1024;
  const Known known;
  double least[2], scale[2];
  int32_t begun[2][BINS] = {}, ended[2][BINS] = {};
  std::vector<int16_t> first_bin[2], last_bin[2];

  INLINE int16_t bin(int d, double distance) const {
    return int16_t(std::clamp((distance - least[d]) * scale[d], 0., BINS - 1.));
  }

  void draw_together(int d, int64_t s, double low, double high) {
    double &near = known.near[d][s], &far = known.far[d][s];
    near = std::max(near, low);
    far = std::min(far, high);
    begun[d][first_bin[d][s]]--;
    begun[d][first_bin[d][s] = bin(d, near)]++;
    ended[d][last_bin[d][s]]--;
    ended[d][last_bin[d][s] = bin(d, far)]++;
  }
};

}  // namespace
