// The threads that work on the pieces of a long text.
#include "text_pieces.h"

#include <system_error>
#include <utility>

namespace rtsg::detail {

PieceReaders::PieceReaders(unsigned threads, std::function<void(TextPiece&)> read) : read_(std::move(read)) {
    try {
        for (unsigned i = 1; i < threads; ++i) threads_.emplace_back([this] { work(); });
    } catch (const std::system_error&) {
        return;  // there are as many as there may be; the reader alone is enough
    }
}

PieceReaders::~PieceReaders() {
    {
        const std::scoped_lock lock(mutex_);
        ended_ = true;
        waiting_.clear();
    }
    forThreads_.notify_all();
}

void PieceReaders::add(TextPiece& piece) {
    {
        const std::scoped_lock lock(mutex_);
        waiting_.push_back(&piece);
    }
    forThreads_.notify_one();
}

TextPiece* PieceReaders::nextLocked() {
    if (waiting_.empty()) return nullptr;
    TextPiece* const piece = waiting_.front();
    waiting_.pop_front();
    piece->state = TextPiece::State::atWork;
    return piece;
}

void PieceReaders::work() {
    std::unique_lock lock(mutex_);
    for (;;) {
        forThreads_.wait(lock, [&] { return ended_ || !waiting_.empty(); });
        TextPiece* const piece = nextLocked();
        if (!piece) return;
        lock.unlock();
        read_(*piece);
        lock.lock();
        piece->state = TextPiece::State::done;
        forReader_.notify_one();
    }
}

void PieceReaders::finish(TextPiece& piece) {
    std::unique_lock lock(mutex_);
    while (piece.state != TextPiece::State::done) {
        TextPiece* const next = nextLocked();
        if (!next) {
            forReader_.wait(lock);
            continue;
        }
        lock.unlock();
        read_(*next);
        lock.lock();
        next->state = TextPiece::State::done;
    }
}

void PieceReaders::drop(TextPiece& piece) {
    std::unique_lock lock(mutex_);
    std::erase(waiting_, &piece);
    forReader_.wait(lock, [&] { return piece.state != TextPiece::State::atWork; });
}

PieceWalk::PieceWalk(const char* from, const Splitting& splitting, Cut cut, std::function<void(TextPiece&)> look)
    : size_(4 * splitting.piece),  // looking is soon done
      maximum_(2 * std::size_t{splitting.threads} + 1),
      cut_(cut),
      next_(from),
      readers_(splitting.threads, std::move(look)) {}

PieceWalk::~PieceWalk() {
    for (TextPiece& piece : pieces_) readers_.drop(piece);
}

bool PieceWalk::add(const char* end) {
    while (!ended_ && pieces_.size() < maximum_) {
        if (end - next_ < static_cast<std::ptrdiff_t>(size_)) return true;
        const char* const cut = cut_(next_, next_ + size_);
        ended_ = cut == next_;
        if (ended_) break;
        pieces_.push_back({.begin = next_, .end = cut, .stop = next_});
        readers_.add(pieces_.back());
        next_ = cut;
    }
    return false;
}

bool PieceWalk::next(const char*& p) {
    if (pieces_.empty()) return false;
    readers_.finish(pieces_.front());
    p = pieces_.front().stop;
    const bool whole = p == pieces_.front().end;
    pieces_.pop_front();
    return whole;
}

}  // namespace rtsg::detail
