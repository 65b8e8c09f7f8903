// A long list of numbers, read ahead by several threads, piece by piece, for the one that joins them.
//
// Invariant: what a piece gives is what reading on from its beginning would have given, since it begins behind white
// space and is used only where the reader comes to that place between two numbers. A piece ends before anything but
// plain numbers: words, comments and complaints are the reader's, one after the other. Threading: all calls are the
// reader's; threads see the text of pieces, which nobody changes, and numbers of their own.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <deque>
#include <memory>
#include <vector>

#include "gathered_numbers.h"
#include "number_run.h"
#include "text_pieces.h"

namespace rtsg::detail {

/// All plain numbers of a piece.
template <class S>
void readPiece(TextPiece& piece) {
    auto* const numbers = static_cast<S*>(piece.numbers);
    const char* p = piece.begin;
    for (;;) {
        piece.count += scanRun(p, piece.end, numbers + piece.count, SIZE_MAX);
        while (p != piece.end && isSpace(*p)) ++p;
        piece.stop = p;
        if (p == piece.end) return;
        // The last bytes, and words that the fast path leaves to the exact scanner.
        if (scanNumber(p, piece.end, numbers[piece.count]) != NumberStatus::ok || p == piece.end || !isSpace(*p))
            return;
        ++piece.count;
    }
}

template <class S>
class NumberPieces {
  public:
    /// `begin`: where a number may begin, of a list that ends with a `]` if it is bracketed.
    NumberPieces(const char* begin, bool bracketed, const Splitting& splitting)
        : size_(splitting.piece), bracketed_(bracketed), next_(begin), readers_(splitting.threads, &readPiece<S>) {
        const std::size_t maximum = 2 * std::size_t{splitting.threads} + 1;
        for (std::size_t i = 0; i < maximum; ++i) {
            buffers_.push_back(std::make_unique_for_overwrite<S[]>(size_ / 2 + 1 + kRunMax));
            free_.push_back(buffers_.back().get());
        }
    }
    ~NumberPieces() {
        while (!pieces_.empty()) drop();
    }
    NumberPieces(const NumberPieces&) = delete;
    NumberPieces& operator=(const NumberPieces&) = delete;

    /// Cuts as many pieces as there may be from the text up to `end`. True if more text would give another.
    bool cut(const char* end);
    /// There is no more text.
    void end() { ended_ = true; }
    /// No piece is left, and none will come.
    bool isEmpty() const { return ended_ && pieces_.empty(); }
    /// The place where reading one by one has to end, since the next piece begins there.
    const char* limit(const char* end) const { return pieces_.empty() ? end : pieces_.front().begin; }
    /// If a piece begins at `p`, which is between two numbers, its numbers are appended, and `p` moves behind them.
    bool take(const char*& p, GatheredNumbers<S>& numbers);

  private:
    void pop() {
        free_.push_back(static_cast<S*>(pieces_.front().numbers));
        pieces_.pop_front();
    }
    void drop() {
        readers_.drop(pieces_.front());
        pop();
    }

    const std::size_t size_;
    const bool bracketed_;
    const char* next_;  // where the next piece begins
    bool ended_ = false;
    std::vector<std::unique_ptr<S[]>> buffers_;
    std::vector<S*> free_;
    std::deque<TextPiece> pieces_;
    PieceReaders readers_;
};

template <class S>
bool NumberPieces<S>::cut(const char* end) {
    while (!ended_ && !free_.empty()) {
        if (end - next_ < static_cast<std::ptrdiff_t>(size_)) return true;
        const char* cut = next_ + size_;
        while (cut != next_ && !isSpace(cut[-1])) --cut;
        // The rest of a list is short, and text without white space is no list.
        ended_ = cut == next_ || (bracketed_ && std::memchr(next_, ']', size_));
        if (ended_) break;
        pieces_.push_back({.begin = next_, .end = cut, .stop = next_, .numbers = free_.back()});
        free_.pop_back();
        readers_.add(pieces_.back());
        next_ = cut;
    }
    return false;
}

template <class S>
bool NumberPieces<S>::take(const char*& p, GatheredNumbers<S>& numbers) {
    while (!pieces_.empty() && p >= pieces_.front().begin) {
        TextPiece& piece = pieces_.front();
        const char* space = std::min(p, piece.end);
        while (space != piece.begin && isSpace(space[-1])) --space;
        if (space != piece.begin || p >= piece.end) {  // a comment goes on where it begins, or beyond it
            drop();
            continue;
        }
        readers_.finish(piece);
        numbers.append({static_cast<const S*>(piece.numbers), piece.count});
        p = std::max(p, piece.stop);
        pop();
        return true;
    }
    return false;
}

}  // namespace rtsg::detail
