#include <algorithm>
#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <rtsg/core/loader.h>

#include "gzip.h"
#include "reader_common.h"
#include "reader_utf8.h"
#include "value/text_position.h"

namespace rtsg {

namespace {

constexpr std::size_t kUnpackedLimit = std::size_t{4} << 30;  // against decompression bombs

std::string_view withoutBom(std::string_view text) {
    constexpr std::string_view bom = "\xEF\xBB\xBF";
    return text.starts_with(bom) ? text.substr(bom.size()) : text;
}

/// XML may declare another encoding than UTF-8, which expat then converts.
bool isOtherXmlEncoding(std::string_view text) {
    if (text.starts_with("\xFE\xFF") || text.starts_with("\xFF\xFE")) return true;
    if (!text.starts_with("<?xml")) return false;
    std::string head(text.substr(0, std::min(text.find("?>"), std::size_t{200})));
    std::ranges::transform(head, head.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    const std::size_t encoding = head.find("encoding");
    return encoding != head.npos && head.find("utf-8", encoding) == head.npos;
}

/// The bytes of a file: mapped if possible, else read.
class FileBytes {
  public:
    FileBytes() = default;
    FileBytes(const FileBytes&) = delete;
    FileBytes& operator=(const FileBytes&) = delete;
    ~FileBytes() {
        if (mapped_) munmap(mapped_, size_);
    }
    std::string_view view() const {
        return mapped_ ? std::string_view(static_cast<const char*>(mapped_), size_) : std::string_view(read_);
    }
    /// Gives back the memory of the first `count` bytes. They can still be read; the system fetches them again.
    void release(std::size_t count) {
        if (mapped_) madvise(mapped_, std::min(count, size_) & ~std::size_t{0xFFFF}, MADV_DONTNEED);
    }
    /// Empty, or why it failed.
    std::string open(const std::filesystem::path& file) {
        const bool standardInput = file == "-";
        const int descriptor = standardInput ? STDIN_FILENO : ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
        if (descriptor < 0) return std::strerror(errno);
        std::string failure = readAll(descriptor);
        if (!standardInput) ::close(descriptor);
        return failure;
    }

  private:
    std::string readAll(int descriptor) {
        struct stat status{};
        if (fstat(descriptor, &status) == 0 && S_ISDIR(status.st_mode)) return "it is a folder";
        if (S_ISREG(status.st_mode) && status.st_size > 0) {
            size_ = static_cast<std::size_t>(status.st_size);
            void* address = mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, descriptor, 0);
            if (address != MAP_FAILED) {
                mapped_ = address;
                return {};
            }
        }
        for (;;) {
            constexpr std::size_t step = 1 << 20;
            const std::size_t before = read_.size();
            read_.resize(before + step);
            const ssize_t got = ::read(descriptor, read_.data() + before, step);
            read_.resize(before + (got > 0 ? static_cast<std::size_t>(got) : 0));
            if (got == 0) return {};
            if (got < 0 && errno != EINTR) return std::strerror(errno);
        }
    }

    void* mapped_ = nullptr;
    std::size_t size_ = 0;
    std::string read_;
};

}  // namespace

Encoding detectEncoding(std::string_view head) {
    if (head.starts_with("\xFE\xFF") || head.starts_with("\xFF\xFE")) return Encoding::xml;
    head = withoutBom(head);
    if (head.starts_with("#VRML")) return Encoding::vrml97;
    const auto start = std::ranges::find_if_not(head, [](char c) { return std::strchr(" \t\r\n", c) && c; });
    if (start != head.end() && *start == '<') return Encoding::xml;
    if (start != head.end() && *start == '{') return Encoding::json;
    return Encoding::classicVrml;
}

namespace {

/// `consumed` is told how far the text has been looked through, so that its memory can be given back.
bool readText(std::string_view text, DocumentHandler& handler, Diagnostics& diagnostics, const Progress& progress,
              const std::function<void(std::size_t)>& consumed) {
    const Encoding encoding = detectEncoding(text);
    text = withoutBom(text);
    if (text.empty()) {
        diagnostics.error({1, 1}, "the document is empty");
        return false;
    }
    std::string clean;
    const bool utf8 = encoding != Encoding::xml || !isOtherXmlEncoding(text);
    if (utf8) {
        const std::size_t bad = detail::findInvalidUtf8(text);
        if (consumed) consumed(text.size());
        if (bad != text.npos) {
            std::size_t count = 0;
            const SourceLocation where = detail::TextPosition(text.data()).of(text.data() + bad);
            clean = detail::replaceInvalidUtf8(text, count);
            diagnostics.error(where, std::to_string(count) +
                                         " bytes are not valid UTF-8 (or zero), the first here; U+FFFD is "
                                         "taken instead");
            text = clean;
        }
    }
    switch (encoding) {
        case Encoding::classicVrml:
        case Encoding::vrml97:
            return detail::readClassic(text, handler, diagnostics, progress);
        case Encoding::xml:
            return detail::readXml(text, utf8, handler, diagnostics, progress);
        case Encoding::json:
            return detail::readJson(text, handler, diagnostics, progress);
        case Encoding::binary:
            break;
    }
    diagnostics.error({1, 1}, "this encoding is not read");
    return false;
}

}  // namespace

bool readDocument(std::string_view text, DocumentHandler& handler, Diagnostics& diagnostics, Progress progress) {
    return readText(text, handler, diagnostics, progress, {});
}

bool readDocumentFile(const std::filesystem::path& file, DocumentHandler& handler, Diagnostics& diagnostics,
                      Progress progress) {
    FileBytes bytes;
    if (const std::string failure = bytes.open(file); !failure.empty()) {
        diagnostics.error({}, "cannot read " + file.string() + ": " + failure);
        return false;
    }
    if (detail::isGzip(bytes.view())) {
        std::string unpacked;
        if (!detail::gunzip(bytes.view(), unpacked, diagnostics, kUnpackedLimit)) return false;
        return readText(unpacked, handler, diagnostics, progress, {});
    }
    const auto consumed = [&bytes](std::size_t count) { bytes.release(count); };
    const Progress step = [&](std::uint64_t done, std::uint64_t total) {
        consumed(done);
        if (progress) progress(done, total);
    };
    return readText(bytes.view(), handler, diagnostics, step, consumed);
}

}  // namespace rtsg
