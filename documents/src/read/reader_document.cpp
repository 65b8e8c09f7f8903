// Opens documents in memory and in files: finds their encoding, unpacks gzip, and reports faults in their bytes.
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <optional>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <rtsg/core/machine.h>
#include <rtsg/core/resource.h>
#include <rtsg/core/web_address.h>
#include <rtsg/documents/read_document.h>

#include "gzip.h"
#include "reader_bytes.h"
#include "reader_common.h"
#include "reader_formats.h"
#include "reader_utf8.h"
#include "text/text_position.h"
#include "text_feed.h"

namespace rtsg {

namespace {

detail::ReaderOptions readerOptions(const ReadOptions& options) {
    // A caller that bounds the text also bounds the memory of its content.
    const std::uint64_t memory = options.maximumBytes == ReadOptions().maximumBytes ? UINT64_MAX : options.maximumBytes;
    return {.progress = options.progress,
            .splitting = detail::splitting(options.threads),
            .headerless = options.headerless,
            .maximumBytes = options.maximumBytes,
            .maximumMemory = memory,
            .time = {.seconds = options.resources ? options.resources->policy().maximumSeconds : UINT64_MAX},
            .clip = options.clip,
            .dialect = options.dialect};
}

}  // namespace

Encoding detectEncoding(std::string_view head) {
    if (head.starts_with("\xFE\xFF") || head.starts_with("\xFF\xFE")) return Encoding::xml;
    head = detail::withoutBom(head);
    if (head.starts_with("#VRML")) return Encoding::vrml97;
    const auto start = std::ranges::find_if_not(head, [](char c) { return std::strchr(" \t\r\n", c) && c; });
    if (start != head.end() && *start == '<') return Encoding::xml;
    if (start != head.end() && *start == '{') return Encoding::json;
    return Encoding::classicVrml;
}

namespace {

/// Ends the reading of a text between two of its blocks: for a handler that takes no more, for the process's memory,
/// and for time.
class ReadingEnd {
  public:
    ReadingEnd(const DocumentHandler& handler, Diagnostics& diagnostics, const detail::ReaderOptions& options)
        : handler_(handler),
          diagnostics_(diagnostics),
          maximum_(options.maximumMemory),
          before_(heldMemory()),
          time_(options.time) {}

    bool isReached() {
        if (!handler_.isFull() && !isOutOfMemory() && !isOutOfTime()) return false;
        reports_ = diagnostics_;
        return true;
    }
    /// Drops reports about the end of the text if the text was cut off on purpose, and says why it was.
    void settle() {
        if (!reports_) return;
        diagnostics_ = std::move(*reports_);
        if (why_) diagnostics_.error({}, why_->text, why_->code);
    }

  private:
    bool isOutOfMemory() {
        constexpr std::uint64_t kBlock = 1 << 20;
        const std::uint64_t held = heldMemory();
        if (auto ok = mayHold(kBlock); !ok)
            why_ = std::move(ok.error());
        else if (held > before_ && held - before_ > maximum_)
            why_ = Diagnostic{Severity::error,
                              {},
                              {},
                              "what is read takes more than " + std::to_string(maximum_) +
                                  " bytes; the rest is left out, unless --limit bytes=N raises this",
                              DiagnosticCode("memory")};
        return why_.has_value();
    }
    bool isOutOfTime() {
        if (time_.isOver())
            why_ = Diagnostic{Severity::error, diagnostics_.file(), {}, time_.text(), DiagnosticCode("build")};
        return why_.has_value();
    }

    const DocumentHandler& handler_;
    Diagnostics& diagnostics_;
    std::uint64_t maximum_, before_;
    detail::TimeLimit time_;
    std::optional<Diagnostics> reports_;
    std::optional<Diagnostic> why_;
};

/// Reads a document whose text is fetched as it is needed.
bool readFed(detail::TextFeed& feed, const detail::OpenBeside& beside, DocumentHandler& handler,
             Diagnostics& diagnostics, const detail::ReaderOptions& options) {
    feed.fill(detail::TextFeed::kHead);
    detail::FeedSource source(feed, beside, options, diagnostics);
    const std::string_view text(feed.begin(), feed.end());
    const FormatReader* reader = detail::findReader({options.name, text, feed.size()}, options.dialect.get());
    if (!reader) {
        diagnostics.error({}, detail::whyNotRead(text), DiagnosticCode("not-a-scene"));
        return false;
    }
    const bool complete = detail::readBy(*reader, source, handler, diagnostics);
    if (feed.invalid())
        diagnostics.error(feed.firstInvalid(), std::to_string(feed.invalid()) +
                                                   " bytes are not valid UTF-8 (or zero), the first here; U+FFFD is "
                                                   "taken instead");
    source.reportFailure();
    return complete;
}

/// Whether bytes that are no UTF-8 are to be replaced.
bool isText(std::string_view head, std::uint64_t size, const detail::ReaderOptions& options) {
    if (detail::isOtherXmlEncoding(head)) return false;
    const FormatReader* reader = detail::findReader({options.name, head, size}, options.dialect.get());
    return reader && reader->isText;
}

bool readFeed(detail::TextFeed& feed, const detail::OpenBeside& beside, DocumentHandler& handler,
              Diagnostics& diagnostics, const detail::ReaderOptions& options) {
    ReadingEnd end(handler, diagnostics, options);
    feed.stopWhen([&] { return end.isReached(); });
    feed.decideBy([&](std::string_view head, std::uint64_t size) { return isText(head, size, options); });
    const bool complete = readFed(feed, beside, handler, diagnostics, options);
    end.settle();
    return complete && !feed.wasStopped();
}

}  // namespace

bool readDocument(std::string_view text, DocumentHandler& handler, Diagnostics& diagnostics,
                  const ReadOptions& options) {
    return detail::readText(text, {}, handler, diagnostics, readerOptions(options));
}

bool detail::readText(std::string_view text, const OpenBeside& beside, DocumentHandler& handler,
                      Diagnostics& diagnostics, const detail::ReaderOptions& options) {
    // A long text comes in blocks, between which the reading can end.
    constexpr std::size_t whole = 1 << 22;
    if (text.size() > whole) {
        auto feed = TextFeed::ofMemory(text, 3 * text.size());
        if (feed) return readFeed(**feed, beside, handler, diagnostics, options);
        diagnostics.error({}, feed.error().text, feed.error().code);
        return false;
    }
    std::string clean;
    const bool utf8 = isText(text.substr(0, TextFeed::kHead), text.size(), options);
    const std::size_t bad = utf8 ? detail::findInvalidUtf8(text, options.splitting) : text.npos;
    if (bad != text.npos) {
        std::size_t count = 0;
        const std::string_view body = detail::withoutBom(text);
        const SourceLocation where = detail::TextPosition(body.data()).of(text.data() + bad);
        clean = detail::replaceInvalidUtf8(text, count);
        diagnostics.error(where, std::to_string(count) +
                                     " bytes are not valid UTF-8 (or zero), the first here; U+FFFD is "
                                     "taken instead");
        text = clean;
    }
    TextFeed feed(text);
    return readFeed(feed, beside, handler, diagnostics, options);
}

namespace detail {

OpenBeside openBeside(Resources resources, std::filesystem::path folder) {
    if (folder.empty()) folder = resources.folder();
    return [resources = std::move(resources), folder = std::move(folder)](std::string_view url) -> Result<std::string> {
        auto file = resources.open(folder, url);
        if (!file) return std::unexpected(file.error());
        return file->read();
    };
}

bool readResource(Resource& resource, std::uint64_t maximumBytes, const TimeLimit& time, const OpenBeside& beside,
                  std::shared_ptr<const Dialect> dialect, DocumentHandler& handler, Diagnostics& diagnostics) {
    ReaderOptions options = readerOptions({});
    options.time = time;
    options.mustBeHeaded = true;
    options.dialect = std::move(dialect);
    const bool isAddress = isWebAddress(resource.name());
    options.name = plainName(
        std::string_view(resource.name()).substr(0, isAddress ? resource.name().find('?') : std::string::npos));
    options.maximumBytes = options.maximumMemory = maximumBytes;
    const auto fed = [&](const Result<std::unique_ptr<TextFeed>>& feed) {
        if (!feed) diagnostics.error({}, feed.error().text, feed.error().code);
        return feed && readFeed(**feed, beside, handler, diagnostics, options);
    };
    if (resource.descriptor() >= 0) return fed(TextFeed::of(resource.descriptor(), maximumBytes));
    const auto bytes = resource.read();
    if (!bytes) {
        diagnostics.error({}, bytes.error().text, bytes.error().code);
        return false;
    }
    if (isGzip(*bytes)) return fed(TextFeed::ofMemory(*bytes, maximumBytes));
    return readText(*bytes, beside, handler, diagnostics, options);
}

}  // namespace detail

bool detail::readDescriptorInBlocks(int descriptor, std::size_t block, const OpenBeside& beside,
                                    DocumentHandler& handler, Diagnostics& diagnostics, const ReaderOptions& options) {
    auto feed = TextFeed::of(descriptor, options.maximumBytes, block);
    if (!feed) {
        diagnostics.error({}, "cannot read " + diagnostics.file() + ": " + feed.error().text, DiagnosticCode("file"));
        return false;
    }
    return readFeed(**feed, beside, handler, diagnostics, options);
}

namespace {

/// Its own urls start where the answer came from.
bool readAddress(const std::filesystem::path& address, DocumentHandler& handler, Diagnostics& diagnostics,
                 const ReadOptions& options) {
    const Resources resources = options.resources ? *options.resources : Resources();
    auto opened = resources.open({}, address.native());
    if (!opened) {
        diagnostics.error({}, opened.error().text, opened.error().code);
        return false;
    }
    constexpr std::size_t block = 1 << 20;
    detail::ReaderOptions reading = readerOptions(options);
    const std::string name = opened->path().string();
    reading.name = detail::plainName(std::string_view(name).substr(0, name.find('?')));
    const detail::OpenBeside beside = detail::openBeside(resources, resources.folderBehind({}, name));
    return detail::readDescriptorInBlocks(opened->descriptor(), block, beside, handler, diagnostics, reading);
}

}  // namespace

bool readDocumentFile(const std::filesystem::path& file, DocumentHandler& handler, Diagnostics& diagnostics,
                      const ReadOptions& options) {
    if (isWebAddress(file.native())) return readAddress(file, handler, diagnostics, options);
    constexpr std::size_t block = 1 << 20;
    detail::ReaderOptions reading = readerOptions(options);
    reading.name = detail::plainName(file.native());
    const auto cannot = [&](const std::string& why) {
        diagnostics.error({}, "cannot read " + file.string() + ": " + why, DiagnosticCode("file"));
        return false;
    };
    if (file == "-") return detail::readDescriptorInBlocks(STDIN_FILENO, block, {}, handler, diagnostics, reading);
    const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor < 0) return cannot(std::strerror(errno));
    struct stat status{};
    const bool isFolder = fstat(descriptor, &status) == 0 && S_ISDIR(status.st_mode);
    const bool complete =
        isFolder ? cannot("it is a folder")
                 : detail::readDescriptorInBlocks(descriptor, block, detail::openBeside(Resources::ofFile(file), {}),
                                                  handler, diagnostics, reading);
    ::close(descriptor);
    return complete;
}

}  // namespace rtsg
