// The threads that read the pieces of long lists of numbers.
#include "number_pieces.h"

#include <system_error>

namespace rtsg::detail {

PieceReaders::PieceReaders(unsigned threads, void (*read)(NumberPiece&)) : read_(read) {
    try {
        for (unsigned i = 1; i < threads; ++i) threads_.emplace_back([this] { work(); });
    } catch (const std::system_error&) {  // there are as many as there may be; the reader alone is enough
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

void PieceReaders::add(NumberPiece& piece) {
    {
        const std::scoped_lock lock(mutex_);
        waiting_.push_back(&piece);
    }
    forThreads_.notify_one();
}

NumberPiece* PieceReaders::nextLocked() {
    if (waiting_.empty()) return nullptr;
    NumberPiece* const piece = waiting_.front();
    waiting_.pop_front();
    piece->state = NumberPiece::State::atWork;
    return piece;
}

void PieceReaders::work() {
    std::unique_lock lock(mutex_);
    for (;;) {
        forThreads_.wait(lock, [&] { return ended_ || !waiting_.empty(); });
        NumberPiece* const piece = nextLocked();
        if (!piece) return;
        lock.unlock();
        read_(*piece);
        lock.lock();
        piece->state = NumberPiece::State::done;
        forReader_.notify_one();
    }
}

void PieceReaders::finish(NumberPiece& piece) {
    std::unique_lock lock(mutex_);
    while (piece.state != NumberPiece::State::done) {
        NumberPiece* const next = nextLocked();
        if (!next) {
            forReader_.wait(lock);
            continue;
        }
        lock.unlock();
        read_(*next);
        lock.lock();
        next->state = NumberPiece::State::done;
    }
}

void PieceReaders::drop(NumberPiece& piece) {
    std::unique_lock lock(mutex_);
    std::erase(waiting_, &piece);
    forReader_.wait(lock, [&] { return piece.state != NumberPiece::State::atWork; });
}

}  // namespace rtsg::detail
