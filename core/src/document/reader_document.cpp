// Documents in memory and in files: which encoding they are in, gzip, and what is wrong with their bytes.
#include <algorithm>
#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <rtsg/core/loader.h>

#include "gzip.h"
#include "reader_bytes.h"
#include "reader_common.h"
#include "reader_utf8.h"
#include "value/read_descriptor.h"
#include "value/text_position.h"

namespace rtsg {

namespace {

constexpr std::size_t kBytesLimit = std::size_t{4} << 30;  // of what says nothing of its size: packed files, pipes

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

/// The content of the file that the user named; whatever kind of file that is.
Result<std::string> readNamedFile(const std::filesystem::path& file) {
    if (file == "-") return detail::readDescriptor(STDIN_FILENO, kBytesLimit);
    const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor < 0) return fail(std::strerror(errno));
    struct stat status{};
    const bool isFolder = fstat(descriptor, &status) == 0 && S_ISDIR(status.st_mode);
    // A pipe or a device may go on for ever.
    auto text = isFolder ? fail("it is a folder")
                         : detail::readDescriptor(descriptor, S_ISREG(status.st_mode) ? SIZE_MAX : kBytesLimit);
    ::close(descriptor);
    return text;
}

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

/// A text file that is no scene could be taken for ClassicVRML, and its words would come out as errors one by one.
bool isHeaded(std::string_view text) {
    return detectEncoding(text) != Encoding::classicVrml || withoutBom(text).starts_with("#X3D");
}

}  // namespace

bool readDocument(std::string_view text, DocumentHandler& handler, Diagnostics& diagnostics, Progress progress) {
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

namespace detail {

bool readSceneBytes(std::string_view bytes, DocumentHandler& handler, Diagnostics& diagnostics,
                    const SceneBytes& options) {
    std::string unpacked;
    if (isGzip(bytes)) {
        if (!gunzip(bytes, unpacked, diagnostics, options.limit)) return false;
        bytes = unpacked;
    }
    if (options.mustBeHeaded && !isHeaded(bytes)) {
        diagnostics.error({}, "it starts neither with #X3D or #VRML, nor as XML or JSON");
        return false;
    }
    return readDocument(bytes, handler, diagnostics, options.progress);
}

}  // namespace detail

bool readDocumentFile(const std::filesystem::path& file, DocumentHandler& handler, Diagnostics& diagnostics,
                      Progress progress) {
    const auto text = readNamedFile(file);
    if (!text) {
        diagnostics.error({}, "cannot read " + file.string() + ": " + text.error().text);
        return false;
    }
    return detail::readSceneBytes(*text, handler, diagnostics, {kBytesLimit, false, std::move(progress)});
}

}  // namespace rtsg
