// Writes the triangles of a flattened scene as STL, OBJ, PLY and GLB.
#include <rtsg/renderers/mesh_file.h>

#include <cmath>
#include <utility>

#include "glb_file.h"
#include "left_out.h"
#include "shown_shapes.h"

namespace rtsg {

namespace {

using mesh_files::Output;
using mesh_files::Shapes;

Vec3f placed(const WorldFromLocal& m, Vec3f p) {
    return Vec3f(m * glm::dvec4(Vec3d(p), 1.0));
}

/// Mirrored shapes show their other side unless two corners change places.
template <class Visit>
void forEachTriangle(const Shapes& shapes, const Visit& visit) {
    for (const Instance* instance : shapes.instances) {
        const Mesh& mesh = shapes.meshOf(*instance);
        const bool mirrored = determinantSign(instance->worldFromLocal) < 0;
        for (std::uint32_t t = 0; t < mesh.triangleCount; ++t)
            visit(placed(instance->worldFromLocal, mesh.vertex(t, 0)),
                  placed(instance->worldFromLocal, mesh.vertex(t, mirrored ? 2 : 1)),
                  placed(instance->worldFromLocal, mesh.vertex(t, mirrored ? 1 : 2)));
    }
}

Vec3f unitNormal(Vec3f a, Vec3f b, Vec3f c) {
    const Vec3d n = glm::cross(Vec3d(b) - Vec3d(a), Vec3d(c) - Vec3d(a));
    const double length = glm::length(n);
    return length > 0 ? Vec3f(n / length) : Vec3f(0);
}

void writeStl(const Shapes& shapes, Output& out) {
    std::string head = "binary STL";
    head.resize(80, ' ');
    out.write(head);
    out.put(static_cast<std::uint32_t>(shapes.content.triangles));
    forEachTriangle(shapes, [&](Vec3f a, Vec3f b, Vec3f c) {
        for (const Vec3f v : {unitNormal(a, b, c), a, b, c}) {
            out.put(v.x);
            out.put(v.y);
            out.put(v.z);
        }
        out.put(std::uint16_t{0});
    });
}

void writePly(const Shapes& shapes, Output& out) {
    std::size_t points = 0;
    for (const Instance* instance : shapes.instances) points += shapes.meshOf(*instance).positions.size();
    out.print(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\n"
        "property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        points, shapes.content.triangles);
    for (const Instance* instance : shapes.instances)
        for (const Vec3f& point : shapes.meshOf(*instance).positions) {
            const Vec3f p = placed(instance->worldFromLocal, point);
            out.put(p.x);
            out.put(p.y);
            out.put(p.z);
        }
    std::int32_t first = 0;
    for (const Instance* instance : shapes.instances) {
        const Mesh& mesh = shapes.meshOf(*instance);
        const bool mirrored = determinantSign(instance->worldFromLocal) < 0;
        for (std::uint32_t t = 0; t < mesh.triangleCount; ++t) {
            out.put(std::uint8_t{3});
            for (const std::uint32_t corner : {0u, mirrored ? 2u : 1u, mirrored ? 1u : 2u})
                out.put(first + static_cast<std::int32_t>(mesh.vertexIndex(t, corner)));
        }
        first += static_cast<std::int32_t>(mesh.positions.size());
    }
}

void writeObj(const Scene& scene, const Shapes& shapes, Output& out) {
    std::size_t first = 1, firstNormal = 1, firstCoord = 1;
    for (const Instance* instance : shapes.instances) {
        const VertexArrays arrays = vertexArrays(shapes.meshOf(*instance));
        const std::string_view name = scene.name(instance->shape);
        out.print("o {}\n", name.empty() ? fmt::format("shape{}", instance->id.slot) : std::string(name));
        const glm::dmat3 normals = glm::transpose(glm::inverse(glm::dmat3(instance->worldFromLocal)));
        const bool mirrored = determinantSign(instance->worldFromLocal) < 0;
        for (const Vec3f& point : arrays.positions) {
            const Vec3f p = placed(instance->worldFromLocal, point);
            out.print("v {} {} {}\n", p.x, p.y, p.z);
        }
        for (const Vec2f& t : arrays.texCoords) out.print("vt {} {}\n", t.x, t.y);
        for (const Vec3f& normal : arrays.normals) {
            Vec3d n = normals * Vec3d(normal);
            const double length = glm::length(n);
            if (length > 0 && std::isfinite(length)) n /= length;
            out.print("vn {} {} {}\n", static_cast<float>(n.x), static_cast<float>(n.y), static_cast<float>(n.z));
        }
        const bool coords = arrays.texCoords.size() == arrays.positions.size();
        for (std::size_t i = 0; i + 2 < arrays.triangles.size(); i += 3) {
            out.write("f");
            for (const std::size_t corner : {i, mirrored ? i + 2 : i + 1, mirrored ? i + 1 : i + 2}) {
                const std::size_t v = arrays.triangles[corner];
                if (coords)
                    out.print(" {}/{}/{}", first + v, firstCoord + v, firstNormal + v);
                else
                    out.print(" {}//{}", first + v, firstNormal + v);
            }
            out.write("\n");
        }
        first += arrays.positions.size();
        firstNormal += arrays.normals.size();
        firstCoord += arrays.texCoords.size();
    }
}

}  // namespace

bool meshFormatFromName(const std::filesystem::path& file, MeshFormat& format) {
    constexpr std::pair<std::string_view, MeshFormat> known[] = {
        {".stl", MeshFormat::stl}, {".obj", MeshFormat::obj}, {".ply", MeshFormat::ply}, {".glb", MeshFormat::glb}};
    const std::string extension = file.extension();
    for (const auto& [name, its] : known)
        if (name == extension) {
            format = its;
            return true;
        }
    return false;
}

Result<MeshFileContent> writeMeshFile(const Scene& scene, const std::filesystem::path& file, MeshFormat format,
                                      Diagnostics& diagnostics, Existing existing, const Resources& pictures,
                                      Flattener flattener) {
    const Shapes shapes(scene, std::move(flattener));
    diagnostics.append(shapes.flattener.diagnostics());
    if (shapes.content.triangles == 0) return fail("the scene shows no triangles", {}, file.string());
    if (shapes.content.triangles > 0x7FFFFFFF / 3) return fail("the scene has too many triangles", {}, file.string());
    mesh_files::reportLeftOut(scene, shapes, format == MeshFormat::glb, diagnostics);
    auto created = OutputFile::create(file, existing);
    if (!created) return std::unexpected(created.error());
    Output out(*created);
    if (format == MeshFormat::stl) {
        writeStl(shapes, out);
    } else if (format == MeshFormat::ply) {
        writePly(shapes, out);
    } else if (format == MeshFormat::obj) {
        writeObj(scene, shapes, out);
    } else {
        mesh_files::GlbWriter writer(scene, shapes, pictures, diagnostics);
        if (!writer.fits()) return fail("a GLB file has at most 4 GiB", {}, file.string());
        writer.write(out);
    }
    if (auto ok = out.finish(); !ok) return std::unexpected(ok.error());
    if (auto ok = created->commit(); !ok) return std::unexpected(ok.error());
    return shapes.content;
}

}  // namespace rtsg
