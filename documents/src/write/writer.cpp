// Writers by encoding, and documents in files: plain or gzipped, under their name once they are complete.
#include <rtsg/documents/writer.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <iterator>
#include <optional>
#include <ostream>
#include <span>
#include <utility>

#include <fmt/format.h>
#include <unistd.h>
#include <zlib.h>

#include <rtsg/core/never_destroyed.h>

#include "guarded_writer.h"
#include "writer_common.h"

namespace rtsg {

namespace detail {

std::string_view accessWord(Access access, bool vrml97) {
    switch (access) {
        case Access::initializeOnly:
            return vrml97 ? "field" : "initializeOnly";
        case Access::inputOnly:
            return vrml97 ? "eventIn" : "inputOnly";
        case Access::outputOnly:
            return vrml97 ? "eventOut" : "outputOnly";
        case Access::inputOutput:
            return vrml97 ? "exposedField" : "inputOutput";
    }
    return {};
}

std::string x3dVersion(const DocumentHeader& header) {
    const std::string& version = header.version;
    const bool spelled = version.size() <= 8 && version.find_first_not_of("0123456789.") == version.npos;
    return spelled && (version.starts_with('3') || version.starts_with('4')) ? version : "4.0";
}

namespace {

constexpr std::size_t kWidth = 100, kFullAt = 1 << 16;
constexpr std::size_t kMaxNumbers = 4;  // in an element of a list

/// `element(i)` appends one.
template <class Element>
void appendLines(std::string& out, std::size_t size, TextSyntax syntax, std::size_t indent,
                 const std::function<void()>& full, const Element& element) {
    const bool classic = syntax == TextSyntax::classicVrml;
    std::size_t start = out.size(), lineStart = start;
    bool broken = false;
    if (classic) out += '[';
    for (std::size_t i = 0; i < size; ++i) {
        if (i) {
            if (classic) out += ',';
            if (out.size() - lineStart > kWidth) {
                // A list of several lines begins on its own.
                if (!broken && classic) out.insert(start + 1, "\n" + std::string(indent, ' '));
                broken = true;
                if (full && out.size() >= kFullAt) {
                    full();
                    start = 0;
                }
                out += '\n';
                lineStart = out.size();
                out.append(indent, ' ');
            } else {
                out += ' ';
            }
        }
        element(i);
    }
    if (classic) out += ']';
}

/// One element of a list of numbers, of which `each` make one.
template <class S>
struct NumberElement {
    std::string& out;
    const S* numbers;
    std::size_t each;
    TextSyntax syntax;

    void operator()(std::size_t i) const {
        char text[kMaxNumbers * (kLongestNumber + 1)];
        char* end = text;
        for (std::size_t k = 0; k < each; ++k) {
            if (k) *end++ = ' ';
            end = printNumber(end, numbers[i * each + k], syntax);
        }
        out.append(text, end);
    }
};

}  // namespace

void appendWrapped(std::string& out, const Value& value, TextSyntax syntax, std::size_t indent,
                   const std::function<void()>& full) {
    const std::size_t size = elementsIn(value);
    if (size < 2) {
        appendFieldText(out, value, syntax);
        return;
    }
    const bool numbers = withNumbers(value, [&](const auto* first, std::size_t count, std::size_t each) {
        appendLines(out, count / each, syntax, indent, full, NumberElement{out, first, each, syntax});
    });
    if (numbers) return;
    appendLines(out, size, syntax, indent, full, [&](std::size_t i) { appendArrayElement(out, value, i, syntax); });
}

}  // namespace detail

namespace {

using NamedEncoding = std::pair<std::string_view, Encoding>;
constexpr NamedEncoding kExtensions[] = {{".x3d", Encoding::xml},    {".x3dv", Encoding::classicVrml},
                                         {".wrl", Encoding::vrml97}, {".vrml", Encoding::vrml97},
                                         {".json", Encoding::json},  {".x3dj", Encoding::json}};

/// A writer of the library's own, under the names of files that are in its encoding.
FormatWriter writerOf(std::string name, Encoding encoding) {
    FormatWriter result;
    result.name = std::move(name);
    for (const auto& [extension, its] : kExtensions)
        if (its == encoding) result.extensions.emplace_back(extension);
    result.make = [encoding](TextSink sink, Diagnostics& diagnostics) {
        return makeWriter(encoding, std::move(sink), diagnostics);
    };
    return result;
}

std::span<const FormatWriter> builtinWriters() {
    static const auto& all = neverDestroyed([] {
        return std::array<FormatWriter, 4>{writerOf("XML", Encoding::xml),
                                           writerOf("ClassicVRML", Encoding::classicVrml),
                                           writerOf("VRML97", Encoding::vrml97), writerOf("JSON", Encoding::json)};
    });
    return all;
}

/// The extension of a file's name, without the sign of gzip.
std::string plainExtension(const std::filesystem::path& file, bool& gzip) {
    std::filesystem::path name = file.filename();
    gzip = name.extension() == ".gz";
    if (gzip) name = name.stem();
    return name.extension();
}

/// Null if no file of such a name can be written. Those of a dialect come first.
const FormatWriter* findWriter(const std::filesystem::path& file, const Dialect* dialect, bool& gzip) {
    const std::string extension = plainExtension(file, gzip);
    if (dialect)
        if (const FormatWriter* own = dialect->writerOf(extension)) return own;
    for (const FormatWriter& writer : builtinWriters())
        for (const std::string& known : writer.extensions) {
            const bool packed = extension == known + 'z';
            if (extension != known && !packed) continue;
            gzip = gzip || packed;
            return &writer;
        }
    return nullptr;
}

}  // namespace

TextSink streamSink(std::ostream& stream) {
    return [&stream](std::string_view text) { stream.write(text.data(), static_cast<std::streamsize>(text.size())); };
}

std::unique_ptr<DocumentHandler> makeWriter(Encoding encoding, TextSink sink, Diagnostics& diagnostics) {
    switch (encoding) {
        case Encoding::xml:
            return detail::makeXmlWriter(std::move(sink), diagnostics);
        case Encoding::json:
            return detail::makeJsonWriter(std::move(sink), diagnostics);
        case Encoding::classicVrml:
        case Encoding::vrml97:
            return detail::makeClassicWriter(std::move(sink), diagnostics, encoding == Encoding::vrml97);
        default:
            return nullptr;
    }
}

bool encodingFromName(const std::filesystem::path& file, Encoding& encoding, bool& gzip) {
    const std::string extension = plainExtension(file, gzip);
    for (const auto& [known, its] : kExtensions) {
        const bool packed = extension == std::string(known) + "z";
        if (extension != known && !packed) continue;
        encoding = its;
        gzip = gzip || packed;
        return true;
    }
    return false;
}

Result<> checkDocumentName(const std::filesystem::path& file, const Dialect* dialect) {
    bool gzip = false;
    if (findWriter(file, dialect, gzip)) return {};
    std::string more;
    if (dialect)
        for (const FormatWriter& writer : dialect->writers())
            for (const std::string& extension : writer.extensions) more += ", " + extension;
    return fail("no encoding that can be written has names like " + file.filename().string() +
                "; there are .x3d, .x3dv, .wrl and .json" + more + ", and with gzip .x3dz, .x3dvz, .wrlz");
}

struct DocumentFileWriter::File {
    std::optional<OutputFile> file;  // else standard output
    gzFile packed = nullptr;         // writes into `file`
    std::string waiting;             // for the next write() of a plain file
    Result<> result;
    const detail::GuardedWriter* guarded = nullptr;  // the writer, but for standard output

    ~File() {
        if (packed) gzclose(packed);
    }
    void note(bool good) {
        if (!good && result) result = fail(std::string("cannot write: ") + std::strerror(errno));
    }
    void flush() {
        if (auto ok = file->write(waiting); !ok && result) result = ok;
        waiting.clear();
    }
    void write(std::string_view text) {
        constexpr std::size_t kPiece = 1 << 16;
        if (!result) return;
        if (packed)
            note(gzfwrite(text.data(), 1, text.size(), packed) == text.size());
        else if (!file)
            note(std::fwrite(text.data(), 1, text.size(), stdout) == text.size());
        else if (waiting.append(text).size() >= kPiece)
            flush();
    }
    Result<> close() {
        if (guarded && result) result = guarded->state();
        if (packed) note(gzclose(std::exchange(packed, nullptr)) == Z_OK);
        if (!file) note(std::fflush(stdout) == 0);
        if (file && result) flush();
        return file && result ? file->commit() : result;
    }
};

DocumentFileWriter::~DocumentFileWriter() = default;

Result<std::unique_ptr<DocumentFileWriter>> DocumentFileWriter::create(const std::filesystem::path& file,
                                                                       Diagnostics& diagnostics, Existing existing,
                                                                       Encoding ofStandardOutput,
                                                                       std::shared_ptr<const Dialect> dialect) {
    std::unique_ptr<DocumentFileWriter> result(new DocumentFileWriter);
    result->file_ = std::make_unique<File>();
    File& out = *result->file_;
    bool gzip = false;
    const FormatWriter* format = nullptr;  // none: of standard output
    if (file != "-") {
        if (auto ok = checkDocumentName(file, dialect.get()); !ok) return std::unexpected(std::move(ok.error()));
        format = findWriter(file, dialect.get(), gzip);
        auto created = OutputFile::create(file, existing);
        if (!created) return std::unexpected(created.error());
        out.file = std::move(*created);
        // gzclose() closes the descriptor that it was given, so it gets a copy.
        if (gzip) out.packed = gzdopen(::dup(out.file->descriptor()), "wb");
        if (gzip && !out.packed) return fail("cannot pack what is written", {}, file.string());
    }
    TextSink sink = [&out](std::string_view text) { out.write(text); };
    if (!format) {
        result->writer_ = makeWriter(ofStandardOutput, std::move(sink), diagnostics);
        return result;
    }
    auto guarded = std::make_unique<detail::GuardedWriter>(*format, std::move(sink), diagnostics);
    if (auto ok = guarded->state(); !ok) return std::unexpected(ok.error());
    out.guarded = guarded.get();
    result->writer_ = std::move(guarded);
    return result;
}

Result<> DocumentFileWriter::close() {
    return file_->close();
}

}  // namespace rtsg
