// Joins pieces of text that wait, and puts them into a file without a name, so that it is gone with the process.
#include "writer_waiting.h"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>

#include <fcntl.h>
#include <unistd.h>

#include "writer_common.h"

namespace rtsg::detail {

namespace {

constexpr std::size_t kMaxHeld = std::size_t{16} << 20;
constexpr std::size_t kLongest = 1 << 14;   // of a piece that is joined
constexpr std::size_t kShortest = 1 << 10;  // of one that is worth a place in the file

std::size_t bytesOf(const Value& list) {
    std::size_t bytes = 0;
    withNumbers(list, [&](const auto* first, std::size_t count, std::size_t) { bytes = count * sizeof(*first); });
    return bytes;
}

int openNameless() {
    std::error_code error;
    std::string name = (std::filesystem::temp_directory_path(error) / "rtsg-text-XXXXXX").string();
    const int file = error ? -1 : ::mkostemp(name.data(), O_CLOEXEC);
    if (file >= 0) ::unlink(name.c_str());
    return file;
}

}  // namespace

bool isLongList(const Value& value) {
    constexpr std::size_t longest = 1 << 12;
    return isMF(value.type()) && elementsIn(value) > longest &&
           withNumbers(value, [](const auto*, std::size_t, std::size_t) {});
}

Waiting::~Waiting() {
    if (file_ >= 0) ::close(file_);
}

bool Waiting::isMuch() const {
    return held_ > longest_ + kMaxHeld && !failed_;
}

/// Behind what of the piece is there already, which was the last that was stored.
bool Waiting::store(std::string_view text, WaitingText& piece) {
    if (failed_) return false;
    if (file_ < 0) file_ = openNameless();
    failed_ = file_ < 0;
    std::uint64_t end = size_;
    for (std::string_view rest = text; !rest.empty() && !failed_;) {
        const ssize_t done = ::pwrite(file_, rest.data(), rest.size(), static_cast<off_t>(end));
        if (done < 0 && errno == EINTR) continue;
        failed_ = done <= 0;
        if (failed_) break;
        rest.remove_prefix(static_cast<std::size_t>(done));
        end += static_cast<std::uint64_t>(done);
    }
    if (failed_) return false;
    if (piece.stored == 0) piece.at = size_;
    piece.stored += text.size();
    size_ = end;
    return true;
}

/// False where not all of it came into the file: then the piece is as it was.
bool Waiting::storeList(WaitingText& piece) {
    const std::uint64_t before = size_;
    std::string text;
    bool good = true;
    const auto full = [&] {
        good = good && store(text, piece);
        text.clear();
    };
    print_(text, piece, full);
    full();
    if (good) {
        piece.numbers = {};
    } else {
        piece.stored = 0;
        size_ = before;
    }
    return good;
}

void Waiting::settle(WaitingText& piece) {
    const bool isList = isLongList(piece.numbers);
    const bool gone = isMuch() && piece.stored == 0 &&
                      (isList ? storeList(piece) : piece.text.size() >= kShortest && store(piece.text, piece));
    if (gone && !isList) piece.text = {};
    piece.text.shrink_to_fit();
    const std::size_t list = isList && !gone ? bytesOf(piece.numbers) : 0;
    longest_ = std::max(longest_, list);
    held_ += piece.text.size() + list - piece.counted;
    piece.counted = piece.text.size() + list;
}

void Waiting::add(Rope& rope, WaitingText piece) {
    rope.push_back(std::move(piece));
    join(rope, std::prev(rope.end()));
}

void Waiting::add(Rope& rope, Rope&& pieces) {
    if (pieces.empty()) return;
    const auto first = pieces.begin();
    rope.splice(rope.end(), std::move(pieces));
    join(rope, first);
}

Rope::iterator Waiting::join(Rope& rope, Rope::iterator at) {
    if (at != rope.begin()) {
        const auto before = std::prev(at);
        if (before->isClosed()) {
            // Nothing to join with.
        } else if (before->text.size() + at->text.size() > kLongest) {
            settle(*before);
        } else {
            before->text += at->text;
            before->at = at->at;
            before->stored = at->stored;
            before->numbers = std::move(at->numbers);
            before->indent = at->indent;
            before->counted += at->counted;
            rope.erase(at);
            at = before;
        }
    }
    if (isLongList(at->numbers)) settle(*at);
    return at;
}

bool Waiting::send(WaitingText& piece, const TextSink& sink) {
    sink(piece.text);
    std::string text(static_cast<std::size_t>(std::min<std::uint64_t>(piece.stored, kFlushAt)), '\0');
    for (std::uint64_t done = 0; done < piece.stored;) {
        const std::size_t wanted = static_cast<std::size_t>(std::min<std::uint64_t>(piece.stored - done, text.size()));
        const ssize_t got = ::pread(file_, text.data(), wanted, static_cast<off_t>(piece.at + done));
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) return false;
        sink(std::string_view(text).substr(0, static_cast<std::size_t>(got)));
        done += static_cast<std::uint64_t>(got);
    }
    if (isLongList(piece.numbers)) {
        text.clear();
        const auto full = [&] {
            sink(text);
            text.clear();
        };
        print_(text, piece, full);
        full();
    }
    piece = {};
    return true;
}

void Waiting::clear() {
    held_ = longest_ = 0;
    if (size_ != 0 && ::ftruncate(file_, 0) == 0) size_ = 0;
}

}  // namespace rtsg::detail
