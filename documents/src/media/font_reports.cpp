// Reads the fonts of FontLibrary nodes, and finds the styles that ask for them.
#include "font_reports.h"

#include <algorithm>
#include <cstring>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "commands/document_head.h"
#include "fetch_ahead.h"
#include "font_file.h"

namespace rtsg {

namespace {

using Library = x3d::FontLibrary;

/// No font is larger; it is kept whole in the scene.
constexpr std::uint64_t kLargestFont = std::uint64_t{64} << 20;

bool isStyle(const Node& node) {
    return node.is(x3d::FontStyle::type) || node.is(x3d::ScreenFontStyle::type);
}

/// How many bytes there are, and these.
Array<std::int32_t> packedFont(std::string_view bytes) {
    Array<std::int32_t> words = Array<std::int32_t>::ofSize(1 + (bytes.size() + 3) / 4);
    std::int32_t* out = words.mutableData();
    out[words.size() - 1] = 0;
    out[0] = static_cast<std::int32_t>(bytes.size());
    if (!bytes.empty()) std::memcpy(out + 1, bytes.data(), bytes.size());
    return words;
}

Result<Array<std::int32_t>> fontOf(const Scene& scene, const Node& library, std::string_view url,
                                   const Resources& resources) {
    auto file = resources.open(scene, library, Library::url.index, url);
    if (!file) return std::unexpected(file.error());
    if (file->size() > kLargestFont)
        return fail(fmt::format("'{}' has {} bytes, and fonts of up to {} are read", urlForMessage(url), file->size(),
                                kLargestFont));
    const auto bytes = file->read();
    if (!bytes) return std::unexpected(bytes.error());
    std::string why;
    if (!detail::isFontFile(*bytes, why)) return fail(fmt::format("'{}' is not used: {}", urlForMessage(url), why));
    return packedFont(*bytes);
}

bool isEqualFamily(std::string_view a, std::string_view b) {
    const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + ('a' - 'A')) : c; };
    return std::ranges::equal(a, b, {}, lower, lower);
}

bool hasFamily(const Node& library, std::string_view family) {
    return std::ranges::any_of(library.get(Library::family),
                               [&](const String& one) { return isEqualFamily(one.view(), family); });
}

/// `libraries` in the order in which they were made.
NodeId libraryFor(const Scene& scene, NodeId scope, const Array<String>& families,
                  const std::set<std::uint32_t>& libraries) {
    for (const String& family : families) {
        const std::string_view name = family.view();
        if (name == "SERIF" || name == "SANS" || name == "TYPEWRITER") return {};
        for (const std::uint32_t number : libraries) {
            const Node* library = scene.find(NodeId{number});
            if (library && library->scope() == scope && !library->get(Library::_font).empty() &&
                hasFamily(*library, name))
                return library->id();
        }
    }
    return {};
}

template <class Style>
bool linkStyle(Scene& scene, const Node& style, const std::set<std::uint32_t>& libraries) {
    const NodeId found = libraryFor(scene, style.scope(), style.get(Style::family), libraries);
    return found != style.get(Style::_library) && scene.set(style.id(), Style::_library, found).has_value();
}

std::size_t linkStyles(Scene& scene, const std::set<std::uint32_t>& styles, const std::set<std::uint32_t>& libraries) {
    std::size_t count = 0;
    for (const std::uint32_t number : styles) {
        const Node* style = scene.find(NodeId{number});
        if (!style) continue;
        const bool edited = style->is(x3d::FontStyle::type) ? linkStyle<x3d::FontStyle>(scene, *style, libraries)
                                                            : linkStyle<x3d::ScreenFontStyle>(scene, *style, libraries);
        if (edited) ++count;
    }
    return count;
}

}  // namespace

bool readFont(Scene& scene, NodeId id, const Resources& resources, Diagnostics& diagnostics, SourceLocation where) {
    const Node& library = scene.node(id);
    Array<std::int32_t> font;
    std::string why;
    if (library.get(Library::load)) {
        for (const String& url : library.get(Library::url)) {
            auto read = fontOf(scene, library, url.view(), resources);
            if (read) {
                font = *std::move(read);
                break;
            }
            why += (why.empty() ? "" : "; ") + read.error().text;
        }
    }
    const std::string_view name = scene.name(id);
    const std::string label = name.empty() ? "FontLibrary" : fmt::format("FontLibrary {}", name);
    if (!why.empty() && font.empty()) diagnostics.error(where, fmt::format("{}: {}", label, why));
    if (!why.empty() && !font.empty())
        diagnostics.warning(where, fmt::format("{}: {}; another of its urls is taken", label, why));
    if (!font.empty() && library.get(Library::family).empty())
        diagnostics.warning(where, fmt::format("{}: its family is empty, so no text asks for its font", label));
    if (font == library.get(Library::_font)) return false;
    return scene.set(id, Library::_font, font).has_value();
}

std::size_t linkFontStyles(Scene& scene) {
    std::set<std::uint32_t> libraries, styles;
    scene.forEachNode([&](const Node& node) {
        if (node.is(Library::type)) libraries.insert(node.id().value);
        if (isStyle(node)) styles.insert(node.id().value);
    });
    return linkStyles(scene, styles, libraries);
}

FontReports::FontReports(const Scene& scene) {
    scene.forEachNode([&](const Node& node) { noteNode(node); });
    // The loader of the document has read and linked these libraries, and reported those that cannot be read.
    unread_.clear();
    linking_ = false;
}

void FontReports::noteNode(const Node& node) {
    if (isStyle(node)) {
        styles_.insert(node.id().value);
        linking_ |= !libraries_.empty();
    }
    if (!node.is(Library::type)) return;
    libraries_.insert(node.id().value);
    if (node.get(Library::_font).empty() && node.get(Library::load) && !node.get(Library::url).empty())
        unread_.insert(node.id().value);
    linking_ = true;
}

void FontReports::note(const Scene& scene, const ChangeSet& set) {
    for (const Change& change : set.changes) {
        const std::uint32_t number = change.node.value;
        if (change.kind == ChangeKind::destroyNode) {
            styles_.erase(number);
            unread_.erase(number);
            linking_ |= libraries_.erase(number) > 0;
            continue;
        }
        if (change.kind == ChangeKind::createNode) {
            if (const Node* node = scene.find(change.node)) noteNode(*node);
            continue;
        }
        // Most changes are of other types: they cost no look at their node.
        if (change.kind != ChangeKind::setField || libraries_.empty()) continue;
        const FieldType type = change.value.type();
        if (type != FieldType::MFString && type != FieldType::SFBool) continue;
        const Node* node = scene.find(change.node);
        if (!node) continue;
        if (node->is(Library::type)) {
            if (change.field == Library::family.index) linking_ = true;
            if (change.field == Library::url.index || change.field == Library::load.index) unread_.insert(number);
        } else if (isStyle(*node) && type == FieldType::MFString) {
            linking_ = true;
        }
    }
}

std::size_t FontReports::answer(Scene& scene, const Resources& resources, Diagnostics& diagnostics) {
    std::size_t count = 0;
    for (const std::uint32_t number : std::exchange(unread_, {})) {
        const Node* library = scene.find(NodeId{number});
        if (library && library->get(Library::load) && awaitsUrls(scene, *library, Library::url.index, resources)) {
            unread_.insert(number);
            continue;
        }
        if (!library || !readFont(scene, NodeId{number}, resources, diagnostics, {})) continue;
        linking_ = true;
        ++count;
    }
    return std::exchange(linking_, false) ? count + linkStyles(scene, styles_, libraries_) : count;
}

}  // namespace rtsg
