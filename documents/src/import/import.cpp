// Finds the kind of a file by its bytes, and holds functions that all importers share.
#include "import.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>

#include "text/number_text.h"

namespace rtsg::detail {

namespace {

struct Magic {
    std::string_view start, what;
};
constexpr std::array kNotRead = std::to_array<Magic>({
    {std::string_view("\xE0\x00\x00\x01", 4), "X3D in the binary encoding (X3DB, Fast Infoset)"},
    {"<?xml encoding='finf'", "X3D in the binary encoding (X3DB, Fast Infoset)"},
    {"\x89PNG", "a picture (PNG)"},
    {"\xABKTX 2", "a picture (KTX2)"},
    {"v/1\x01", "a picture (OpenEXR)"},
    {"\xFF\xD8\xFF", "a picture (JPEG)"},
    {"GIF8", "a picture (GIF)"},
    {"PK\x03\x04", "a ZIP archive (as USDZ, 3MF and KMZ files are)"},
    {"%PDF", "a PDF document"},
    {"#usda ", "a USD file, as text"},
    {"PXR-USDC", "a USD file, binary"},
    {"ISO-10303-21;", "a STEP file (ISO 10303-21), as IFC files are"},
    {"HIERARCHY", "a BVH file of motions"},
    {"Ogawa", "an Alembic file"},
    {"DRACO", "a mesh compressed by Draco"},
    {"b3dm", "a tile of 3D Tiles"},
    {"i3dm", "a tile of 3D Tiles"},
    {"pnts", "a tile of 3D Tiles"},
    {"cmpt", "a tile of 3D Tiles"},
    {"OggS", "a sound or a film (Ogg)"},
    {"fLaC", "a sound (FLAC)"},
    {"BLENDER", "a Blender file"},
    {"#Inventor", "an Open Inventor file"},
    {"#VRML V1.0", "VRML 1.0, which is another language than VRML97"},
    {"RTSGrec1", "a log or a scene in RTSG's binary encoding (rtsg convert and rtsg replay read them)"},
    {"RIFF", "a sound or a film (RIFF)"},
    {"\x7F"
     "ELF",
     "a program"},
});

bool isAnyOf(std::string_view word, std::initializer_list<std::string_view> words) {
    return std::ranges::find(words, word) != words.end();
}

/// The name of the outermost element of XML, without a prefix.
std::string_view rootElement(std::string_view text) {
    constexpr std::pair<std::string_view, std::string_view> passed[] = {{"<?", "?>"}, {"<!--", "-->"}, {"<!", ">"}};
    for (;;) {
        text.remove_prefix(std::min(text.find_first_not_of(" \t\r\n"), text.size()));
        const auto found = std::ranges::find_if(passed, [&](const auto& one) { return text.starts_with(one.first); });
        if (found == std::end(passed)) break;
        const std::size_t end = text.find(found->second);
        if (end == text.npos) return {};
        text.remove_prefix(end + found->second.size());
    }
    if (!text.starts_with('<')) return {};
    std::string_view name = text.substr(1, text.find_first_of(" \t\r\n/>", 1) - 1);
    name.remove_prefix(name.find(':') + 1);  // npos + 1 is 0
    return name;
}

/// The kind of an XML document that is no X3D, by its outermost element.
std::string_view otherXml(std::string_view head) {
    constexpr std::pair<std::string_view, std::string_view> known[] = {
        {"ifcXML", "an IFC file, as XML"}, {"kml", "a KML file"},  {"svg", "a picture (SVG)"},
        {"CityModel", "a CityGML file"},   {"amf", "an AMF file"}, {"model", "a 3MF model"},
        {"mujoco", "a MuJoCo model"}};
    const std::string_view root = rootElement(head);
    for (const auto& [name, what] : known)
        if (name == root) return what;
    return {};
}

/// Text in UTF-16 whose first character is known: XML may be so, other text may not.
std::string_view inUtf16(std::string_view head) {
    const std::size_t sign = head.find_first_not_of(std::string_view("\xFE\xFF\0 \t\r\n", 7));
    if (sign == head.npos || head[sign] == '<') return {};
    const std::size_t next = head.find_first_not_of('\0', sign + 1);
    const bool isHeader = head[sign] == '#' && next != head.npos && (head[next] == 'X' || head[next] == 'V');
    if (isHeader || head[sign] == '{')
        return "ClassicVRML or JSON in UTF-16, which by their standards are in UTF-8 alone";
    return "text in UTF-16, as XML may be; OBJ, PLY and STL are in ASCII or UTF-8";
}

/// Describes a file that begins neither like a text document nor like anything else that is known. A zero byte within a
/// document is reported by its reader.
std::string_view strange(std::string_view head) {
    if (head.starts_with("\xFE\xFF") || head.starts_with("\xFF\xFE") || head.starts_with(std::string_view("<\0", 2)) ||
        head.starts_with(std::string_view("\0<", 2)))
        return inUtf16(head);
    if (head.starts_with("\xEF\xBB\xBF")) head.remove_prefix(3);
    const std::size_t start = std::min(head.find_first_not_of(" \t\r\n"), head.size());
    if (start == head.size() || head[start] == '<') return otherXml(head.substr(start));
    if (std::string_view("{#").contains(head[start])) return {};
    if (head.contains('\0'))
        return "no text, and of no binary kind that is known here (a binary STL file has 84 bytes, and 50 for each "
               "facet that it counts)";
    return head[start] == '[' ? "a list of JSON, which is no X3D" : std::string_view();
}

/// Calls `see` with the keys of the JSON object that a text begins with, as far as the text goes, until that returns
/// true; returns whether it did.
template <class See>
bool seeKeys(std::string_view text, const See& see) {
    int depth = 0;
    for (std::size_t i = 0; i < text.size(); ++i) {
        if (text[i] == '{' || text[i] == '[') ++depth;
        if (text[i] == '}' || text[i] == ']') --depth;
        if (text[i] != '"') continue;
        const std::size_t start = ++i;
        for (; i < text.size() && text[i] != '"'; ++i)
            if (text[i] == '\\') ++i;
        const std::size_t next = text.find_first_not_of(" \t\r\n", i + 1);
        const bool isKey = depth == 1 && next != text.npos && text[next] == ':';
        if (isKey && see(text.substr(start, i - start))) return true;
    }
    return false;
}

/// Tells JSON of glTF from that of X3D by the keys of its object, whose order means nothing.
FileKind kindOfJson(std::string_view head, std::uint64_t size) {
    const auto isGltf = [](std::string_view key) {
        return isAnyOf(key, {"asset", "scene", "scenes", "nodes", "meshes", "accessors", "bufferViews", "buffers",
                             "materials", "textures", "images", "samplers", "cameras", "skins", "animations",
                             "extensionsUsed", "extensionsRequired"});
    };
    bool any = false;
    const auto isX3d = [&](std::string_view key) { return any = true, key == "X3D"; };
    if (seeKeys(head, isX3d)) return FileKind::document;
    // Only the head of the file has been read; X3D would show itself there.
    return seeKeys(head, isGltf) || (any && size > head.size()) ? FileKind::gltf : FileKind::document;
}

/// Files of robots and modellers; `document`: none of these.
FileKind kindOfOthers(std::string_view head, std::uint64_t size) {
    constexpr std::pair<std::string_view, FileKind> begins[] = {{"Kaydara FBX Binary", FileKind::fbx},
                                                                {"; FBX", FileKind::fbx},
                                                                {"OFF\n", FileKind::off},
                                                                {"OFF\r", FileKind::off}};
    for (const auto& [start, kind] : begins)
        if (head.starts_with(start)) return kind;
    constexpr std::size_t chunkHead = 6;  // 3DS: all of the file is one chunk
    std::uint32_t length = 0;
    if (head.starts_with("MM") && head.size() > chunkHead) std::memcpy(&length, head.data() + 2, sizeof(length));
    if (length > chunkHead && length == size) return FileKind::threeDs;
    const std::string_view root = rootElement(head.starts_with("\xEF\xBB\xBF") ? head.substr(3) : head);
    return root == "robot"                     ? FileKind::urdf
           : root == "sdf" || root == "gazebo" ? FileKind::sdf
           : root == "COLLADA"                 ? FileKind::collada
                                               : FileKind::document;
}

bool looksLikeObj(std::string_view head) {
    LineScanner lines(head);
    while (lines.nextLine()) {
        const std::string_view word = lines.word();
        if (word.empty() || word[0] == '#') continue;
        if (isAnyOf(word, {"mtllib", "usemtl"})) return true;
        float number = 0;
        if (isAnyOf(word, {"v", "vn", "vt"})) return lines.number(number) && lines.number(number);
        if (!isAnyOf(word, {"o", "g", "s", "f", "l"})) return false;
    }
    return false;
}

}  // namespace

FileKind fileKind(std::string_view head, std::uint64_t size) {
    if (head.starts_with("glTF")) return FileKind::glb;
    for (const Magic& magic : kNotRead)
        if (head.starts_with(magic.start)) return FileKind::notRead;
    if (head.starts_with("ply\n") || head.starts_with("ply\r")) return FileKind::ply;
    if (head.starts_with("#X3D") || head.starts_with("#VRML")) return FileKind::document;
    constexpr std::size_t stlHead = 84, stlFacet = 50;
    if (head.size() >= stlHead && size >= stlHead) {
        std::uint32_t facets = 0;
        std::memcpy(&facets, head.data() + 80, sizeof(facets));
        if (facets > 0 && size == stlHead + stlFacet * std::uint64_t{facets}) return FileKind::stl;
    }
    if (const FileKind kind = kindOfOthers(head, size); kind != FileKind::document) return kind;
    if (!strange(head).empty()) return FileKind::notRead;
    const bool isMarked = head.starts_with("\xEF\xBB\xBF{");
    const std::size_t start = isMarked ? 3 : head.find_first_not_of(" \t\r\n");
    if (start == head.npos || head[start] == '<') return FileKind::document;
    if (head[start] == '{') return kindOfJson(head.substr(start), size);
    const std::string_view text = head.substr(start);
    if (text.starts_with("solid") && (text.find("facet") != text.npos || text.find("endsolid") != text.npos))
        return FileKind::stl;
    return looksLikeObj(head) ? FileKind::obj : FileKind::document;
}

std::string whyNotRead(std::string_view head) {
    for (const Magic& magic : kNotRead)
        if (head.starts_with(magic.start)) return "it is " + std::string(magic.what) + ", and is not read here";
    return "it is " + std::string(strange(head)) + ", and is not read here";
}

void beginImported(DocumentHandler& handler, std::string_view from, std::string_view version) {
    DocumentHeader header;
    header.encoding = Encoding::xml;
    header.version = version;
    header.profile = "Full";
    header.valuesFirst = true;
    handler.beginDocument(header);
    handler.meta("translated", from, {});
}

namespace {

void writeTexCoords(DocumentHandler& handler, ImportedMesh& mesh) {
    if (mesh.namedTexCoords.empty()) {
        if (mesh.texCoords.empty()) return;
        mesh.namedTexCoords.push_back({{}, std::move(mesh.texCoords)});
    }
    const bool several = mesh.namedTexCoords.size() > 1;
    if (several) handler.beginNode("MultiTextureCoordinate", {}, "texCoord", {});
    for (ImportedMesh::Named& one : mesh.namedTexCoords) {
        handler.beginNode("TextureCoordinate", {}, "texCoord", {});
        if (!one.mapping.empty()) handler.setField("mapping", Value(String(one.mapping)), {});
        handler.setField("point", Value(std::move(one.texCoords)), {});
        handler.endNode({});
    }
    if (several) handler.endNode({});
}

}  // namespace

void writeAppearance(DocumentHandler& handler, const char* material) {
    handler.beginNode("Appearance", {}, "appearance", {});
    handler.beginNode(material, {}, "material", {});
    handler.endNode({});
    handler.endNode({});
}

void writeMesh(DocumentHandler& handler, ImportedMesh mesh) {
    const bool isPoints = mesh.faces.empty();
    handler.beginNode(isPoints         ? "PointSet"
                      : mesh.triangles ? "IndexedTriangleSet"
                                       : "IndexedFaceSet",
                      {}, "geometry", {});
    if (!isPoints) {
        if (!mesh.solid) handler.setField("solid", Value(false), {});
        if (!mesh.smooth) handler.setField("normalPerVertex", Value(false), {});
        handler.setField(mesh.triangles ? "index" : "coordIndex", Value(std::move(mesh.faces)), {});
        if (!mesh.normalIndex.empty()) handler.setField("normalIndex", Value(std::move(mesh.normalIndex)), {});
        if (!mesh.texCoordIndex.empty()) handler.setField("texCoordIndex", Value(std::move(mesh.texCoordIndex)), {});
    }
    const auto property = [&](const char* type, const char* field, const char* values, Value value) {
        handler.beginNode(type, {}, field, {});
        handler.setField(values, std::move(value), {});
        handler.endNode({});
    };
    if (mesh.pointsGiven) {
        handler.useNode(mesh.pointsName, "coord", {});
    } else {
        handler.beginNode("Coordinate", mesh.pointsName, "coord", {});
        handler.setField("point", Value(std::move(mesh.points)), {});
        handler.endNode({});
    }
    if (!mesh.normals.empty()) property("Normal", "normal", "vector", Value(std::move(mesh.normals)));
    if (!mesh.tangents.empty() && !isPoints) property("Tangent", "tangent", "vector", Value(std::move(mesh.tangents)));
    if (!isPoints) writeTexCoords(handler, mesh);
    if (!mesh.colors.empty()) property("ColorRGBA", "color", "color", Value(std::move(mesh.colors)));
    handler.endNode({});
}

void LineScanner::skipBlanks() {
    for (; p_ != end_; ++p_) {
        if (*p_ == '\\' && end_ - p_ > 1 && (p_[1] == '\n' || (p_[1] == '\r' && end_ - p_ > 2 && p_[2] == '\n'))) {
            p_ += p_[1] == '\r' ? 2 : 1;
            ++line_;
        } else if (*p_ != ' ' && *p_ != '\t') {
            return;
        }
    }
}

bool LineScanner::nextLine() {
    if (line_ != 0) {
        while (p_ != end_ && *p_ != '\n') {
            skipBlanks();
            if (p_ != end_ && *p_ != '\n') ++p_;
        }
        if (p_ != end_) ++p_;
    }
    ++line_;
    return p_ != end_;
}

std::string_view LineScanner::word() {
    skipBlanks();
    const char* start = p_;
    while (p_ != end_ && *p_ != ' ' && *p_ != '\t' && *p_ != '\n' && *p_ != '\r') ++p_;
    return {start, static_cast<std::size_t>(p_ - start)};
}

std::string_view LineScanner::rest() {
    skipBlanks();
    const char* start = p_;
    while (p_ != end_ && *p_ != '\n') ++p_;
    std::string_view text(start, static_cast<std::size_t>(p_ - start));
    while (!text.empty() && isSpace(text.back())) text.remove_suffix(1);
    return text;
}

bool LineScanner::number(float& out) {
    skipBlanks();
    return p_ != end_ && scanReal(p_, end_, out) == NumberStatus::ok;
}

bool LineScanner::integer(std::int64_t& out) {
    skipBlanks();
    const auto [stop, error] = std::from_chars(p_, end_, out);
    if (error != std::errc()) return false;
    p_ = stop;
    return true;
}

}  // namespace rtsg::detail
