// Writes a bench scene as ClassicVRML text.
#include "scene_file.h"

#include <charconv>
#include <utility>

namespace rtsg::bench {

SceneFile::SceneFile(const std::filesystem::path& file) : path_(file), file_(std::fopen(file.c_str(), "wb")) {
    raw("#X3D V4.0 utf8\nPROFILE Immersive\n");
}

void SceneFile::number(float value) {
    // A tenth of a millimetre, without zeros that say nothing.
    char text[64];
    char* end = std::to_chars(text, text + sizeof text, value, std::chars_format::fixed, 4).ptr;
    while (end[-1] == '0') --end;
    if (end[-1] == '.') --end;
    if (end - text == 2 && text[0] == '-' && text[1] == '0') text[0] = '0', --end;
    buffer_.append(text, end);
    buffer_ += ' ';
}
void SceneFile::integer(std::int32_t value) {
    char text[16];
    buffer_.append(text, std::to_chars(text, text + sizeof text, value).ptr);
    buffer_ += ' ';
}

void SceneFile::flush() {
    if (!file_ || std::fwrite(buffer_.data(), 1, buffer_.size(), file_.get()) != buffer_.size()) failed_ = true;
    buffer_.clear();
}

void SceneFile::look(std::string_view name, const Look& l) {
    raw("Switch {{ children Shape {{ appearance DEF {} Appearance {{\n", name);
    raw(" material Material {{ diffuseColor {} {} {} specularColor {} {} {} shininess {} transparency {} "
        "emissiveColor {} {} {}",
        l.diffuse.x, l.diffuse.y, l.diffuse.z, l.specular, l.specular, l.specular, l.shininess, l.transparency,
        l.emissive.x, l.emissive.y, l.emissive.z);
    if (l.mirror > 0 || l.refraction > 0) {
        raw(" metadata MetadataSet {{ name \"RTSG\" value [");
        if (l.mirror > 0) raw(" MetadataFloat {{ name \"reflectivity\" value {} }}", l.mirror);
        if (l.refraction > 0) raw(" MetadataFloat {{ name \"refractiveIndex\" value {} }}", l.refraction);
        raw(" ] }}");
    }
    raw(" }}\n");
    if (l.texture.empty()) return raw("}} }} }}\n");
    textured_.emplace(name);
    raw(" texture ImageTexture {{ url \"{}\" }} textureTransform TextureTransform {{ scale {} {} }}\n", l.texture,
        l.repeats.x, l.repeats.y);
    raw("}} }} }}\n");
}

void SceneFile::transformHead(const Placement& p) {
    raw("Transform {{");
    if (p.translation != Vec3f(0)) raw(" translation {} {} {}", p.translation.x, p.translation.y, p.translation.z);
    if (p.rotation.angle != 0) raw(" rotation {} {} {} {}", p.rotation.x, p.rotation.y, p.rotation.z, p.rotation.angle);
    if (p.scale != Vec3f(1)) raw(" scale {} {} {}", p.scale.x, p.scale.y, p.scale.z);
}

void SceneFile::open(const Placement& placement, std::string_view def) {
    if (!def.empty()) raw("DEF {} ", def);
    transformHead(placement);
    raw(" children [\n");
    groups_.push_back({std::string(def), 0});
}
void SceneFile::close() {
    raw("] }}\n");
    const Group done = std::move(groups_.back());
    groups_.pop_back();
    groups_.back().triangles += done.triangles;
    if (!done.def.empty()) named_[done.def] = done.triangles;
}
void SceneFile::use(std::string_view def) {
    raw("USE {}\n", def);
    count(named_.at(std::string(def)));
}
void SceneFile::useAt(const Placement& placement, std::string_view def) {
    transformHead(placement);
    raw(" children USE {} }}\n", def);
    count(named_.at(std::string(def)));
}

void SceneFile::points(const std::vector<Vec3f>& points) {
    for (const Vec3f& p : points) {
        number(p.x), number(p.y), number(p.z);
        buffer_.back() = '\n';
        flushIfLong();
    }
}

void SceneFile::geometry(const Surface& surface, Shading shading, std::string_view def, bool texCoords) {
    if (!def.empty()) {
        raw("DEF {} ", def);
        named_[std::string(def)] = surface.triangleCount();
    }
    raw("{} {{ solid FALSE\ncoord Coordinate {{ point [\n",
        shading == Shading::smooth ? "IndexedTriangleSet" : "IndexedFaceSet");
    points(surface.points);
    raw("] }}\n");
    if (texCoords) {
        raw("texCoord TextureCoordinate {{ point [\n");
        for (const Vec2f& t : surface.texCoords) {
            number(t.x), number(t.y);
            buffer_.back() = '\n';
            flushIfLong();
        }
        raw("] }}\n");
    }
    raw("{} [\n", shading == Shading::smooth ? "index" : "coordIndex");
    for (std::size_t i = 0; i < surface.triangles.size(); i += 3) {
        for (std::size_t k = i; k < i + 3; ++k) integer(surface.triangles[k]);
        if (shading == Shading::flat) buffer_ += "-1\n";
        flushIfLong();
    }
    raw("] }}\n");
}

void SceneFile::shape(const Surface& surface, std::string_view look, Shading shading, std::string_view def) {
    raw("Shape {{ appearance USE {} geometry ", look);
    geometry(surface, shading, def, textured_.contains(std::string(look)));
    raw("}}\n");
    count(surface.triangleCount());
}
void SceneFile::shapeOf(std::string_view geometry, std::string_view look) {
    raw("Shape {{ appearance USE {} geometry USE {} }}\n", look, geometry);
    count(named_.at(std::string(geometry)));
}

Result<std::uint64_t> SceneFile::finish() {
    flush();
    if (!file_ || std::fflush(file_.get()) != 0) failed_ = true;
    file_.reset();
    if (failed_) return fail("the scene cannot be written", {}, path_.string());
    return groups_.back().triangles;
}

}  // namespace rtsg::bench
