// Reads a file into a reserved range of addresses, block by block: unpacked if it is gzip, and made valid UTF-8.
#include "text_feed.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <new>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include "gzip.h"
#include "text/text_position.h"
#include "text/utf8.h"

namespace rtsg::detail {

struct TextFeed::Source {
    int descriptor = -1;
    std::string_view memory;  // in place of a file
    std::size_t memoryRead = 0;
    off_t start = 0;      // where the text starts in the file
    bool isOurs = false;  // the descriptor
    std::uint64_t limit = 0, total = 0, done = 0, textSize = 0;
    std::size_t block = 0;
    char* region = nullptr;  // reserved addresses
    std::size_t page = 1 << 12;
    std::size_t reserved = 0, filled = 0, released = 0;
    std::size_t pending = 0;  // bytes behind `filled` whose character is not complete yet
    bool ended = false;
    bool decided = false, packed = false, memberEnded = false;
    z_stream inflater{};
    std::string packedBytes;
    // Line and column of `filled`, counted while nothing was wrong yet.
    std::uint64_t lines = 0;
    const char* lineStart = nullptr;

    ~Source() {
        if (packed) inflateEnd(&inflater);
        if (region) ::munmap(region, reserved);
        if (isOurs) ::close(descriptor);
    }
};

namespace {

/// At most `most` bytes; 0 at the end; -1 on failure.
ssize_t readSome(int descriptor, char* to, std::size_t maximum) {
    for (;;) {
        const ssize_t got = ::read(descriptor, to, maximum);
        if (got >= 0 || errno != EINTR) return got;
    }
}

constexpr std::size_t kPackedBlock = 1 << 16;
constexpr std::uint64_t kWorst = 3;  // each bad byte becomes three
/// The system gives memory in pages; a long text gets large ones, if the system has them, since handing out small ones
/// and taking them back is most of the cost of reading.
constexpr std::size_t kLargePage = 1 << 21, kLongText = 1 << 24;

}  // namespace

TextFeed::TextFeed(std::unique_ptr<Source> source) : source_(std::move(source)) {
    begin_ = end_ = source_->region;
}
TextFeed::TextFeed(std::string_view text) : begin_(text.data()), end_(begin_ + text.size()) {}
TextFeed::~TextFeed() = default;

Result<std::unique_ptr<TextFeed>> TextFeed::of(int descriptor, std::uint64_t limit, std::size_t block) {
    struct stat status{};
    if (fstat(descriptor, &status) != 0) return fail(std::strerror(errno));
    auto source = std::make_unique<Source>();
    source->descriptor = descriptor;
    source->block = block;
    source->start = std::max<off_t>(0, ::lseek(descriptor, 0, SEEK_CUR));
    if (S_ISREG(status.st_mode)) source->total = static_cast<std::uint64_t>(status.st_size);
    // A packed file may be a thousand times as long unpacked, and says nothing of it.
    char head[2] = {};
    const bool plain =
        S_ISREG(status.st_mode) && !(::pread(descriptor, head, 2, 0) == 2 && isGzip(std::string_view(head, 2)));
    source->textSize = plain ? source->total : 0;
    // Behind a gzip file stands how much it was, if that was less than 4 GiB and there is but one member.
    std::uint32_t unpacked = 0;
    if (!plain && source->total > sizeof(unpacked) &&
        ::pread(descriptor, &unpacked, sizeof(unpacked), static_cast<off_t>(source->total - sizeof(unpacked))) ==
            ssize_t{sizeof(unpacked)})
        source->textSize = unpacked;
    source->limit = plain ? UINT64_MAX : limit;
    const std::uint64_t longest = kWorst * (plain ? source->total : limit);  // before the source is given away
    return of(std::move(source), longest);
}

Result<std::unique_ptr<TextFeed>> TextFeed::ofMemory(std::string_view bytes, std::uint64_t limit) {
    auto source = std::make_unique<Source>();
    source->memory = bytes;
    source->block = 1 << 20;
    source->total = bytes.size();
    source->limit = limit;
    return of(std::move(source), kWorst * limit);
}

/// With addresses for so much text.
Result<std::unique_ptr<TextFeed>> TextFeed::of(std::unique_ptr<Source> source, std::uint64_t longest) {
    source->reserved = longest + 4 * source->block + (1 << 16);
    void* region = MAP_FAILED;
    // A process may have been given few addresses: then as many as there are.
    for (constexpr std::size_t minimum = 1 << 26;; source->reserved /= 2) {
        region = ::mmap(nullptr, source->reserved, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE,
                        -1, 0);
        if (region != MAP_FAILED) break;
        if (source->reserved / 2 < minimum)
            return fail(std::string("there are no addresses for its text: ") + std::strerror(errno));
    }
    source->region = static_cast<char*>(region);
    if (source->total >= kLongText && ::madvise(region, source->reserved, MADV_HUGEPAGE) == 0)
        source->page = kLargePage;
    source->lineStart = source->region;
    return std::unique_ptr<TextFeed>(new TextFeed(std::move(source)));
}

std::unique_ptr<TextFeed> TextFeed::again() const {
    struct stat status{};
    if (source_ && !source_->memory.empty()) {
        auto feed = ofMemory(source_->memory, source_->limit);
        if (!feed) return nullptr;
        (*feed)->fill(skipped_);
        (*feed)->skip(skipped_);
        return std::move(*feed);
    }
    if (!source_ || fstat(source_->descriptor, &status) != 0 || !S_ISREG(status.st_mode)) return nullptr;
    // A description of its own, so that the places of the two in the file are independent.
    const std::string name = "/proc/self/fd/" + std::to_string(source_->descriptor);
    const int descriptor = ::open(name.c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor < 0) return nullptr;
    if (::lseek(descriptor, source_->start, SEEK_SET) != source_->start) {
        ::close(descriptor);
        return nullptr;
    }
    auto feed = of(descriptor, source_->limit, source_->block);
    if (!feed) {
        ::close(descriptor);
        return nullptr;
    }
    (*feed)->source_->isOurs = true;
    (*feed)->fill(skipped_);
    (*feed)->skip(skipped_);
    return std::move(*feed);
}

std::uint64_t TextFeed::done(const char* at) const {
    return source_ ? source_->done : static_cast<std::uint64_t>(at - begin_);
}
std::uint64_t TextFeed::total() const {
    return source_ ? source_->total : static_cast<std::uint64_t>(end_ - begin_);
}

std::uint64_t TextFeed::size() const {
    return source_ ? source_->textSize : static_cast<std::uint64_t>(end_ - begin_);
}

void TextFeed::fill(std::size_t size) {
    while (static_cast<std::size_t>(end_ - begin_) < size && more()) {
    }
}

/// Bytes of the text; 0 at its end, and after a failure.
std::size_t TextFeed::read(char* to, std::size_t maximum) {
    Source& s = *source_;
    const auto raw = [&](char* where, std::size_t count) -> std::size_t {
        if (s.descriptor < 0) {
            const std::size_t copied = s.memory.substr(s.memoryRead).copy(where, count);
            s.memoryRead += copied;
            s.done += copied;
            return copied;
        }
        const ssize_t got = readSome(s.descriptor, where, count);
        if (got < 0) failure_ = std::string("it cannot be read on: ") + std::strerror(errno);
        s.done += got > 0 ? static_cast<std::uint64_t>(got) : 0;
        return got > 0 ? static_cast<std::size_t>(got) : 0;
    };
    if (!s.decided) {
        s.decided = true;
        char head[2];
        std::size_t have = 0;
        while (have < 2) {
            const std::size_t got = raw(head + have, 2 - have);
            if (got == 0) break;
            have += got;
        }
        s.packed = isGzip({head, have});
        if (!s.packed) {
            std::memcpy(to, head, have);
            return have;
        }
        constexpr int gzipOnly = 15 + 16;
        if (inflateInit2(&s.inflater, gzipOnly) != Z_OK) throw std::bad_alloc();
        s.packedBytes.assign(head, have);
        s.inflater.next_in = reinterpret_cast<Bytef*>(s.packedBytes.data());
        s.inflater.avail_in = static_cast<uInt>(have);
    }
    if (!s.packed) return raw(to, maximum);
    s.inflater.next_out = reinterpret_cast<Bytef*>(to);
    s.inflater.avail_out = static_cast<uInt>(maximum);
    while (s.inflater.avail_out == maximum) {
        if (s.inflater.avail_in == 0) {
            s.packedBytes.resize(kPackedBlock);
            const std::size_t got = raw(s.packedBytes.data(), kPackedBlock);
            if (got == 0) {
                if (!s.memberEnded && failure_.empty())
                    failure_ = "the gzip file is truncated; what could be unpacked is used";
                return 0;
            }
            s.inflater.next_in = reinterpret_cast<Bytef*>(s.packedBytes.data());
            s.inflater.avail_in = static_cast<uInt>(got);
        }
        if (s.memberEnded) {
            // Another member, or padding, which is common.
            if (*s.inflater.next_in != 0x1f) return 0;
            inflateReset(&s.inflater);
            s.memberEnded = false;
        }
        const int status = inflate(&s.inflater, Z_NO_FLUSH);
        s.memberEnded = status == Z_STREAM_END;
        if (status != Z_OK && status != Z_STREAM_END && status != Z_BUF_ERROR) {
            failure_ = std::string("the gzip file is damaged (") + (s.inflater.msg ? s.inflater.msg : "zlib") +
                       "); what could be unpacked is used";
            return maximum - s.inflater.avail_out;
        }
    }
    return maximum - s.inflater.avail_out;
}

bool TextFeed::mayReadOn() {
    if (failure_.empty() && !stopped_) stopped_ = enough_ && enough_();
    return failure_.empty() && !stopped_;
}

bool TextFeed::more() {
    if (!source_ || source_->ended) return false;
    Source& s = *source_;
    const char* const before = end_;
    while (end_ == before && !s.ended) {
        char* const to = s.region + s.filled + s.pending;
        const std::size_t room = s.reserved - s.filled - s.pending;
        std::size_t got = 0;
        if (!mayReadOn() || room <= 3 * s.block) {
            if (!stopped_ && failure_.empty())
                failure_ = "there are no more addresses for its text; what was read is used";
        } else {
            got = read(to, s.block);
            // The bytes that decide the encoding must be there together.
            for (std::size_t some = got; s.filled == 0 && s.pending == 0 && got < kHead && some != 0; got += some)
                some = read(to + got, s.block);
            if (s.filled == 0 && isText_) clean_ = isText_({to, std::min(got, kHead)}, size());
        }
        if (s.filled + got > s.limit && failure_.empty()) {
            failure_ = "the text is larger than the limit of " + std::to_string(s.limit) + " bytes";
            got = s.limit > s.filled ? static_cast<std::size_t>(s.limit) - s.filled : 0;
        }
        s.ended = got == 0;
        if (clean_) {
            clean(s.region + s.filled, s.pending + got, s.ended);
        } else {
            s.filled += got;
        }
        end_ = s.region + s.filled;
    }
    return end_ != before;
}

/// Makes the `size` bytes at `from`, the end of the checked text, valid UTF-8; an incomplete character at their end
/// waits for more bytes.
void TextFeed::clean(char* from, std::size_t size, bool last) {
    Source& s = *source_;
    std::string_view text(from, size);
    std::size_t bad = findInvalidUtf8(text);
    if (!last && bad != text.npos && size - bad < 4 && (static_cast<unsigned char>(text[bad]) >= 0xC2u)) {
        // The start of a character may be waiting for its rest.
        s.pending = size - bad;
        s.filled += bad;
        size = bad;
    } else if (bad == text.npos) {
        s.pending = 0;
        s.filled += size;
    } else {
        s.pending = 0;
        if (!last)  // bytes that may begin a character stay as they are
            for (std::size_t back = 1; back < 4 && back <= size - bad - 1; ++back) {
                const auto c = static_cast<unsigned char>(text[size - back]);
                if (c < 0x80u) break;
                if (c < 0xC0u) continue;
                if (findInvalidUtf8(text.substr(size - back)) != text.npos) s.pending = back;
                break;
            }
        const std::string tail(text.substr(size - s.pending));
        if (invalid_ == 0) {
            std::uint32_t column = 1;
            const char* lineStart = s.lineStart;
            for (const char* q = from; q != from + bad; ++q)
                if (*q == '\n') {
                    ++s.lines;
                    lineStart = q + 1;
                }
            // A line's start that has been released counts from there.
            for (const char* q = std::max<const char*>(lineStart, s.region + s.released); q != from + bad; ++q)
                column += (static_cast<unsigned char>(*q) & 0xC0u) != 0x80u;
            firstInvalid_ = {static_cast<std::uint32_t>(s.lines + 1), column};
        }
        std::size_t count = 0;
        const std::string replaced = replaceInvalidUtf8(text.substr(0, size - s.pending), count);
        invalid_ += count;
        std::ranges::copy(tail, std::ranges::copy(replaced, from).out);
        s.filled += replaced.size();
        return;
    }
    if (invalid_ != 0) return;
    for (const char *q = from, *stop = from + size;
         (q = static_cast<const char*>(std::memchr(q, '\n', static_cast<std::size_t>(stop - q)))) != nullptr;) {
        ++s.lines;
        s.lineStart = ++q;
        if (q == stop) break;
    }
}

void TextFeed::release(const char* upTo) {
    constexpr std::size_t step = 1 << 20;
    if (!source_ || upTo < source_->region) return;
    Source& s = *source_;
    const std::size_t behind = reinterpret_cast<std::uintptr_t>(upTo) % s.page;  // where its page begins
    const auto before = static_cast<std::size_t>(upTo - s.region);
    if (before < behind + s.released + step) return;
    const std::size_t whole = before - behind;
    ::madvise(s.region + s.released, whole - s.released, MADV_DONTNEED);
    s.released = whole;
}

bool TextFeed::blank(const char* from, const char* to) {
    if (!source_) return false;
    std::memset(source_->region + (from - source_->region), ' ', static_cast<std::size_t>(to - from));
    return true;
}

}  // namespace rtsg::detail
