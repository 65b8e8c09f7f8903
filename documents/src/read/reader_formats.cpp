// Finds the format of a file, and reads the file by it: the library's own formats and those of a dialect alike.
#include "reader_formats.h"

#include <algorithm>
#include <exception>
#include <vector>

#include <rtsg/core/machine.h>
#include <rtsg/core/never_destroyed.h>
#include <rtsg/documents/read_document.h>

#include "commands/checked_stream.h"
#include "models/import_modeller.h"
#include "models/import_urdf.h"
#include "reader_html.h"
#include "reader_utf8.h"

namespace rtsg::detail {

namespace {

/// A text file that is no scene could be taken for ClassicVRML, and its words would come out as errors one by one.
bool isHeaded(std::string_view text) {
    return detectEncoding(text) != Encoding::classicVrml || withoutBom(text).starts_with("#X3D");
}

/// The text behind a byte order mark; null, and reported, if there is none.
TextFeed* textOf(FeedSource& source, Diagnostics& diagnostics, bool utf8 = true) {
    TextFeed& feed = source.feed();
    const std::string_view text(feed.begin(), feed.end());
    if (source.options().mustBeHeaded && !isHeaded(text)) {
        diagnostics.error({}, "it starts neither with #X3D or #VRML, nor as XML or JSON");
        return nullptr;
    }
    if (utf8) feed.skip(text.size() - withoutBom(text).size());
    if (feed.begin() != feed.end()) return &feed;
    diagnostics.error({1, 1}, "the document is empty");
    return nullptr;
}

using FeedReader = bool (*)(FeedSource& source, DocumentHandler& handler, Diagnostics& diagnostics);

bool readXmlText(FeedSource& source, DocumentHandler& handler, Diagnostics& diagnostics) {
    const std::string_view head(source.feed().begin(), source.feed().end());
    const bool utf8 = !isOtherXmlEncoding(withoutBom(head));
    TextFeed* feed = textOf(source, diagnostics, utf8);
    return feed && readXml(*feed, utf8, handler, diagnostics, source.options());
}

bool readHtmlText(FeedSource& source, DocumentHandler& handler, Diagnostics& diagnostics) {
    TextFeed* feed = textOf(source, diagnostics);
    if (!feed) return false;
    feed->fill();
    const std::string xml = xmlOfHtml({feed->begin(), feed->end()}, diagnostics);
    if (xml.empty()) return false;
    TextFeed own(xml);
    return readXml(own, true, handler, diagnostics, source.options());
}

bool readJsonText(FeedSource& source, DocumentHandler& handler, Diagnostics& diagnostics) {
    TextFeed* feed = textOf(source, diagnostics);
    return feed && readJson(*feed, handler, diagnostics, source.options());
}

bool readClassicText(FeedSource& source, DocumentHandler& handler, Diagnostics& diagnostics) {
    TextFeed* feed = textOf(source, diagnostics);
    return feed && readClassic(*feed, handler, diagnostics, source.options());
}

template <bool (*import)(const ImportInput&, DocumentHandler&, Diagnostics&)>
bool readImported(FeedSource& source, DocumentHandler& handler, Diagnostics& diagnostics) {
    const std::string_view bytes = source.bytes();
    if (source.feed().wasStopped()) return false;
    ImportInput input{bytes, source.openBeside(), source.maximumBytes(), source.clip()};
    input.time = source.options().time;
    return import(input, handler, diagnostics);
}

/// Every source is a FeedSource: nobody else makes one.
template <FeedReader read>
bool byFeed(FormatSource& source, DocumentHandler& handler, Diagnostics& diagnostics) {
    return read(static_cast<FeedSource&>(source), handler, diagnostics);
}

template <FileKind... kinds>
bool isOfKind(const FormatClue& clue) {
    return ((fileKind(clue.head, clue.size) == kinds) || ...);
}

template <Encoding... encodings>
bool isInEncoding(const FormatClue& clue) {
    return isOfKind<FileKind::document>(clue) && ((detectEncoding(clue.head) == encodings) || ...);
}

bool isHtmlPage(const FormatClue& clue) {
    return isInEncoding<Encoding::xml>(clue) && isHtml(withoutBom(clue.head));
}

}  // namespace

std::span<const FormatReader> builtinReaders() {
    static const auto& all = neverDestroyed([] {
        return std::vector<FormatReader>{
            {"HTML", isHtmlPage, byFeed<readHtmlText>, true},
            {"XML", isInEncoding<Encoding::xml>, byFeed<readXmlText>, true},
            {"JSON", isInEncoding<Encoding::json>, byFeed<readJsonText>, true},
            {"glTF", isOfKind<FileKind::gltf, FileKind::glb>, byFeed<readImported<importGltf>>, false, true},
            {"STL", isOfKind<FileKind::stl>, byFeed<readImported<importStl>>},
            {"OBJ", isOfKind<FileKind::obj>, byFeed<readImported<importObj>>},
            {"PLY", isOfKind<FileKind::ply>, byFeed<readImported<importPly>>},
            {"URDF", isOfKind<FileKind::urdf>, byFeed<readImported<importUrdf>>},
            {"SDF", isOfKind<FileKind::sdf>, byFeed<readImported<importSdf>>},
            {"Collada", isOfKind<FileKind::collada, FileKind::fbx, FileKind::threeDs, FileKind::off>,
             byFeed<readImported<importModeller>>, false, true},
            // The last, as it takes what none above has recognised.
            {"ClassicVRML", isInEncoding<Encoding::classicVrml, Encoding::vrml97>, byFeed<readClassicText>, true},
        };
    });
    return all;
}

const FormatReader* findReader(const FormatClue& clue, const Dialect* dialect) {
    if (dialect)
        if (const FormatReader* own = dialect->readerOf({clue.name, clue.head.substr(0, TextFeed::kHead), clue.size}))
            return own;
    const auto found =
        std::ranges::find_if(builtinReaders(), [&](const FormatReader& reader) { return reader.recognises(clue); });
    return found == builtinReaders().end() ? nullptr : &*found;
}

namespace {

/// The library's own text readers keep the rules, so their commands are not checked again.
bool keepsRules(const FormatReader& reader) {
    return reader.isText &&
           std::ranges::any_of(builtinReaders(), [&](const FormatReader& one) { return &one == &reader; });
}

}  // namespace

bool readBy(const FormatReader& reader, FeedSource& source, DocumentHandler& handler, Diagnostics& diagnostics) {
    // TimeSensors of X3D and VRML run or wait as they say themselves.
    if (!source.clip().empty() && !reader.hasClips)
        diagnostics.error({}, "it has no clip " + std::string(source.clip()) + ": only glTF files have clips");
    if (keepsRules(reader)) return reader.read(source, handler, diagnostics);
    constexpr std::uint64_t kArrays = 4;  // bytes of them for each of the file
    if (auto ok = mayHold(kArrays * source.bytes().size()); !ok) {
        diagnostics.error({}, ok.error().text, ok.error().code);
        return false;
    }
    CheckedStream checked(handler, reader.name, source.options().dialect.get(), diagnostics);
    bool complete = false;
    try {
        complete = reader.read(source, checked, diagnostics);
    } catch (const std::exception& e) {
        diagnostics.error({}, "the reader of " + reader.name + " files failed: " + e.what());
    } catch (...) {
        diagnostics.error({}, "the reader of " + reader.name + " files failed");
    }
    checked.close(complete);
    return complete;
}

std::string_view FeedSource::bytes() {
    feed_.fill();
    reportFailure();
    return {feed_.begin(), feed_.end()};
}

Result<std::string> FeedSource::beside(std::string_view url) const {
    if (!beside_) return fail("text in memory has nothing beside it");
    return beside_(url);
}

void FeedSource::reportFailure() {
    if (feed_.failure().empty() || reported_) return;
    reported_ = true;
    diagnostics_.error({}, feed_.failure(), DiagnosticCode("gzip"));
}

std::string_view plainName(std::string_view file) {
    constexpr std::string_view kPacked = ".gz";
    if (file == "-") return {};
    if (file.ends_with(kPacked)) file.remove_suffix(kPacked.size());
    return file;
}

}  // namespace rtsg::detail
