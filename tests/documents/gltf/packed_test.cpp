// Meshes that Draco and meshopt have packed: what comes out is what went in, and what is damaged or counts too much is
// named and left out.
#include <algorithm>
#include <array>
#include <cstring>
#include <random>
#include <regex>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#ifdef RTSG_DRACO
#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#endif
#ifdef RTSG_MESHOPT
#include <meshoptimizer.h>
#endif

#include "gltf_parts.h"

namespace rtsg {
namespace {

using test::GltfParts;
using test::Imported;
using testing::HasSubstr;

/// The numbers of the first field of this name in commands.
std::vector<double> numbersOf(const std::string& commands, const std::string& field) {
    const std::size_t at = commands.find("set " + field + " ");
    if (at == commands.npos) return {};
    const std::size_t begin = commands.find('[', at) + 1;
    std::string text = commands.substr(begin, commands.find(']', begin) - begin);
    std::ranges::replace(text, ',', ' ');
    std::istringstream in(text);
    std::vector<double> result;
    for (double one = 0; in >> one;) result.push_back(one);
    return result;
}

using Corner = std::array<double, 3>;
using Triangle = std::array<Corner, 3>;

/// The triangles by where their corners are, each beginning at its least corner, in order; places are of a grid.
std::vector<Triangle> trianglesOf(const std::string& commands, double step = 1e-3) {
    const std::vector<double> points = numbersOf(commands, "point"), index = numbersOf(commands, "index");
    std::vector<Triangle> result;
    for (std::size_t i = 0; i + 2 < index.size(); i += 3) {
        Triangle one;
        for (std::size_t k = 0; k < 3; ++k)
            for (std::size_t c = 0; c < 3; ++c)
                one[k][c] = std::round(points.at(3 * static_cast<std::size_t>(index[i + k]) + c) / step);
        std::ranges::rotate(one, std::ranges::min_element(one));
        result.push_back(one);
    }
    std::ranges::sort(result);
    return result;
}

/// A bent sheet of n by n squares.
struct Sheet {
    std::vector<float> points, normals;
    std::vector<std::uint32_t> indices;
    std::size_t count = 0;

    explicit Sheet(std::uint32_t n = 6) {
        for (std::uint32_t y = 0; y <= n; ++y)
            for (std::uint32_t x = 0; x <= n; ++x) {
                points.insert(points.end(), {float(x), float(y), float(x * y) / 4});
                normals.insert(normals.end(), {0, 0, 1});
            }
        for (std::uint32_t y = 0; y < n; ++y)
            for (std::uint32_t x = 0; x < n; ++x) {
                const std::uint32_t a = y * (n + 1) + x, b = a + 1, c = a + n + 1, d = c + 1;
                for (const std::uint32_t i : {a, b, c, c, b, d}) indices.push_back(i);
            }
        count = points.size() / 3;
    }
    std::string plain() const {
        GltfParts parts;
        const int position = parts.floats("VEC3", 3, points), normal = parts.floats("VEC3", 3, normals);
        const int index = parts.accessor(5125, "SCALAR", 1, indices);
        return parts.text(meshOf(position, normal, index));
    }
    static std::string meshOf(int position, int normal, int index, const std::string& more = {}) {
        return fmt::format(
            "\"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":{},\"NORMAL\":{}}},\"indices\":{}{}}}]}}],"
            "\"nodes\":[{{\"mesh\":0}}]",
            position, normal, index, more);
    }
};

std::string replaced(std::string text, std::string_view from, std::string_view to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, text.npos) << from;
    return at == text.npos ? text : text.replace(at, from.size(), to);
}

#ifdef RTSG_DRACO

std::string packDraco(const Sheet& sheet, bool sequential = false) {
    draco::TriangleSoupMeshBuilder builder;
    const auto faces = static_cast<int>(sheet.indices.size() / 3);
    builder.Start(faces);
    const int position = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
    const int normal = builder.AddAttribute(draco::GeometryAttribute::NORMAL, 3, draco::DT_FLOAT32);
    for (int f = 0; f < faces; ++f) {
        const auto at = [&](const std::vector<float>& all, int k) {
            return all.data() + 3 * sheet.indices[static_cast<std::size_t>(3 * f + k)];
        };
        const draco::FaceIndex face(static_cast<std::uint32_t>(f));
        builder.SetAttributeValuesForFace(position, face, at(sheet.points, 0), at(sheet.points, 1),
                                          at(sheet.points, 2));
        builder.SetAttributeValuesForFace(normal, face, at(sheet.normals, 0), at(sheet.normals, 1),
                                          at(sheet.normals, 2));
    }
    const std::unique_ptr<draco::Mesh> mesh = builder.Finalize();
    draco::Encoder encoder;
    encoder.SetEncodingMethod(sequential ? draco::MESH_SEQUENTIAL_ENCODING : draco::MESH_EDGEBREAKER_ENCODING);
    encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 14);
    draco::EncoderBuffer buffer;
    EXPECT_TRUE(encoder.EncodeMeshToBuffer(*mesh, &buffer).ok());
    return {buffer.data(), buffer.size()};
}

std::string dracoFile(const std::string& packed, std::size_t points, std::size_t indices,
                      const char* listed = "extensionsRequired") {
    GltfParts parts;
    const int position =
        parts.view(packed, "", fmt::format("\"componentType\":5126,\"count\":{},\"type\":\"VEC3\"", points));
    const int normal = parts.view("", "", fmt::format("\"componentType\":5126,\"count\":{},\"type\":\"VEC3\"", points));
    const int index =
        parts.view("", "", fmt::format("\"componentType\":5123,\"count\":{},\"type\":\"SCALAR\"", indices));
    return parts.text(fmt::format("\"{}\":[\"KHR_draco_mesh_compression\"],", listed) +
                      Sheet::meshOf(position, normal, index,
                                    ",\"extensions\":{\"KHR_draco_mesh_compression\":{\"bufferView\":0,\"attributes\":{"
                                    "\"POSITION\":0,\"NORMAL\":1}}}"));
}

TEST(PackedMeshes, DracoGivesTheTrianglesThatWentIn) {
    const Sheet sheet;
    const Imported plain(sheet.plain());
    ASSERT_EQ(plain.problems, "");
    ASSERT_EQ(trianglesOf(plain.commands).size(), 72u);
    for (const bool sequential : {false, true}) {
        const Imported packed(dracoFile(packDraco(sheet, sequential), sheet.count, sheet.indices.size()));
        EXPECT_EQ(packed.problems, "");
        constexpr double quantised = .01;
        EXPECT_EQ(trianglesOf(packed.commands, quantised), trianglesOf(plain.commands, quantised));
        const std::vector<double> normals = numbersOf(packed.commands, "vector");
        ASSERT_EQ(normals.size(), 3 * sheet.count);
        for (std::size_t i = 2; i < normals.size(); i += 3) EXPECT_NEAR(normals[i], 1, 1e-2);
    }
}

TEST(PackedMeshes, WhatDracoDataSayWrongIsNamed) {
    const Sheet sheet;
    const std::string packed = packDraco(sheet);
    const auto problems = [&](const std::string& bytes, std::size_t points, std::size_t indices) {
        const Imported file(dracoFile(bytes, points, indices));
        EXPECT_EQ(numbersOf(file.commands, "point").size(), 0u);
        return file.problems;
    };
    const std::size_t count = sheet.count, indices = sheet.indices.size();
    EXPECT_THAT(problems(packed, count + 1, indices), HasSubstr("another number of points than its accessors say"));
    EXPECT_THAT(problems(packed, count, indices + 3), HasSubstr("another number of triangles than its accessor says"));
    EXPECT_THAT(problems("", count, indices), HasSubstr("it is no Draco data"));
    EXPECT_THAT(problems("DRACO", count, indices), HasSubstr("it is no Draco data"));
    std::string older = packed;
    older[6] = 1;
    EXPECT_THAT(problems(older, count, indices), HasSubstr("of another Draco bitstream than 2.2"));
    std::string cloud = packed;
    cloud[7] = 0;
    EXPECT_THAT(problems(cloud, count, indices), HasSubstr("it is no mesh"));
    // A billion points and triangles, behind the head and the way they are coded.
    std::string huge = packed.substr(0, 12);
    for (int i = 0; i < 2; ++i) huge += "\x80\x94\xEB\xDC\x03";
    huge += packed.substr(14);
    EXPECT_THAT(problems(huge, count, 3'000'000'000), HasSubstr("it takes more memory than may be had"));
    for (std::size_t size = 5; size < packed.size(); size += 3)
        EXPECT_THAT(problems(packed.substr(0, size), count, indices), HasSubstr("cannot be unpacked")) << size;
    // Without what it names, and as an extension that could be passed over.
    const std::string good = dracoFile(packed, count, indices, "extensionsUsed");
    EXPECT_EQ(Imported(good).problems, "");
    EXPECT_THAT(Imported(replaced(good, "\"NORMAL\":1}}", "\"NORMAL\":9}}")).problems,
                HasSubstr("it lacks an attribute that the file names"));
    EXPECT_THAT(Imported(replaced(good, "\"bufferView\":0,\"attributes\"", "\"bufferView\":7,\"attributes\"")).problems,
                HasSubstr("names number 7 of its bufferViews"));
}

TEST(PackedMeshes, AnyDamageOfDracoDataIsSurvived) {
    const Sheet sheet;
    for (const bool sequential : {false, true}) {
        const std::string packed = packDraco(sheet, sequential);
        std::mt19937 random(11);
        for (int i = 0; i < 400; ++i) {
            std::string spoiled = packed;
            for (unsigned k = 0; k <= random() % 3; ++k)
                spoiled[5 + random() % (spoiled.size() - 5)] = static_cast<char>(random());
            const Imported file(dracoFile(spoiled, sheet.count, sheet.indices.size()));
            for (const double index : numbersOf(file.commands, "index")) ASSERT_LT(index, sheet.count);
        }
    }
}

#endif

#ifdef RTSG_MESHOPT

struct Packed {
    std::string points, normals, indices, sequence;

    explicit Packed(const Sheet& sheet) {
        const auto vertices = [&](const void* data, std::size_t stride) {
            std::string out(meshopt_encodeVertexBufferBound(sheet.count, stride), '\0');
            out.resize(meshopt_encodeVertexBuffer(reinterpret_cast<unsigned char*>(out.data()), out.size(), data,
                                                  sheet.count, stride));
            return out;
        };
        points = vertices(sheet.points.data(), 12);
        std::vector<float> four;
        for (std::size_t i = 0; i < sheet.normals.size(); ++i) {
            four.push_back(sheet.normals[i]);
            if (i % 3 == 2) four.push_back(0);
        }
        std::string octahedral(8 * sheet.count, '\0');
        meshopt_encodeFilterOct(octahedral.data(), sheet.count, 8, 16, four.data());
        normals = vertices(octahedral.data(), 8);
        indices.resize(meshopt_encodeIndexBufferBound(sheet.indices.size(), sheet.count));
        indices.resize(meshopt_encodeIndexBuffer(reinterpret_cast<unsigned char*>(indices.data()), indices.size(),
                                                 sheet.indices.data(), sheet.indices.size()));
        sequence.resize(meshopt_encodeIndexSequenceBound(sheet.indices.size(), sheet.count));
        sequence.resize(meshopt_encodeIndexSequence(reinterpret_cast<unsigned char*>(sequence.data()), sequence.size(),
                                                    sheet.indices.data(), sheet.indices.size()));
    }
};

std::string meshoptFile(const Sheet& sheet, const Packed& packed, bool sequence = false) {
    GltfParts parts;
    const auto view = [&](const std::string& bytes, std::size_t count, std::size_t stride, const char* mode,
                          const std::string& accessor, const char* extra) {
        const std::string members = fmt::format(
            ",\"extensions\":{{\"EXT_meshopt_compression\":{{\"buffer\":0,\"byteOffset\":{},\"byteLength\":{},"
            "\"byteStride\":{},\"count\":{},\"mode\":\"{}\"{}}}}}",
            parts.bytes(), bytes.size(), stride, count, mode, extra);
        return parts.view(bytes, members, accessor);
    };
    const int position =
        view(packed.points, sheet.count, 12, "ATTRIBUTES",
             fmt::format("\"bufferView\":0,\"componentType\":5126,\"count\":{},\"type\":\"VEC3\"", sheet.count), "");
    const int normal =
        view(packed.normals, sheet.count, 8, "ATTRIBUTES",
             fmt::format("\"bufferView\":1,\"componentType\":5122,\"normalized\":true,\"count\":{},\"type\":\"VEC3\"",
                         sheet.count),
             ",\"filter\":\"OCTAHEDRAL\"");
    const int index = view(
        sequence ? packed.sequence : packed.indices, sheet.indices.size(), 4, sequence ? "INDICES" : "TRIANGLES",
        fmt::format("\"bufferView\":2,\"componentType\":5125,\"count\":{},\"type\":\"SCALAR\"", sheet.indices.size()),
        "");
    return parts.text("\"extensionsRequired\":[\"EXT_meshopt_compression\",\"KHR_mesh_quantization\"]," +
                      Sheet::meshOf(position, normal, index));
}

TEST(PackedMeshes, MeshoptGivesTheTrianglesThatWentIn) {
    const Sheet sheet;
    const Imported plain(sheet.plain());
    const Packed packed(sheet);
    for (const bool sequence : {false, true}) {
        const Imported file(meshoptFile(sheet, packed, sequence));
        EXPECT_EQ(file.problems, "");
        EXPECT_EQ(numbersOf(file.commands, "point"), numbersOf(plain.commands, "point"));
        EXPECT_EQ(trianglesOf(file.commands), trianglesOf(plain.commands));
        const std::vector<double> normals = numbersOf(file.commands, "vector");
        ASSERT_EQ(normals.size(), 3 * sheet.count);
        for (std::size_t i = 0; i < normals.size(); ++i) EXPECT_NEAR(normals[i], i % 3 == 2, 1e-3);
    }
}

TEST(PackedMeshes, WhatMeshoptDataSayWrongIsNamed) {
    const Sheet sheet;
    const std::string good = meshoptFile(sheet, Packed(sheet));
    const auto problems = [&](std::string_view from, std::string_view to) {
        return Imported(replaced(good, from, to)).problems;
    };
    EXPECT_THAT(problems("\"filter\":\"OCTAHEDRAL\"", "\"filter\":\"QUATERNION\""), "");  // 8 bytes are right for both
    EXPECT_THAT(problems("\"byteStride\":8,", "\"byteStride\":12,"),
                HasSubstr("buffer view 1 of the glTF file cannot be unpacked: its filter is for elements of 4 or 8"));
    EXPECT_THAT(problems("\"mode\":\"TRIANGLES\"", "\"mode\":\"TRIANGLES\",\"filter\":\"OCTAHEDRAL\""),
                HasSubstr("indices have no filter"));
    EXPECT_THAT(problems("\"filter\":\"OCTAHEDRAL\"", "\"filter\":\"COLOR\""),
                HasSubstr("its filter is none that is known here: COLOR"));
    EXPECT_THAT(problems("\"mode\":\"TRIANGLES\"", "\"mode\":\"LINES\""), HasSubstr("it names no mode"));
    EXPECT_THAT(problems("\"byteStride\":12,\"count\":49", "\"byteStride\":12,\"count\":4900000000"),
                HasSubstr("it counts more elements than its bytes can hold"));
    EXPECT_THAT(problems("\"byteStride\":12,\"count\":49", "\"byteStride\":10,\"count\":49"),
                HasSubstr("its elements have no size that meshopt packs"));
    EXPECT_THAT(problems("\"byteStride\":12,\"count\":49", "\"byteStride\":0,\"count\":49"),
                HasSubstr("its elements have no size that meshopt packs"));
    EXPECT_THAT(problems("\"byteStride\":12,\"count\":49", "\"byteStride\":12,\"count\":48"),
                HasSubstr("its meshopt data are damaged"));
    EXPECT_THAT(problems("\"byteStride\":4,\"count\":216", "\"byteStride\":4,\"count\":217"),
                HasSubstr("its triangles have no three corners"));
    EXPECT_THAT(problems("\"byteStride\":4,", "\"byteStride\":8,"), HasSubstr("have neither 2 nor 4 bytes"));
    EXPECT_THAT(problems("\"mode\":\"ATTRIBUTES\"", "\"mode\":\"INDICES\""), HasSubstr("neither 2 nor 4 bytes"));
    EXPECT_THAT(problems("{\"EXT_meshopt_compression\":{\"buffer\":0,", "{\"EXT_meshopt_compression\":{\"buffer\":3,"),
                HasSubstr("names number 3 of its buffers"));
    EXPECT_THAT(problems("\"byteStride\":12,", "\"byteStride\":12,\"byteLength\":99999,"),
                HasSubstr("reaches beyond its buffer"));
}

TEST(PackedMeshes, AnyDamageOfMeshoptDataIsSurvived) {
    const Sheet sheet;
    const Packed packed(sheet);
    std::mt19937 random(12);
    for (int i = 0; i < 300; ++i) {
        Packed spoiled = packed;
        for (std::string* one : {&spoiled.points, &spoiled.normals, &spoiled.indices}) {
            if (random() % 2) (*one)[random() % one->size()] = static_cast<char>(random());
            if (random() % 8 == 0) one->resize(random() % one->size());
        }
        const Imported file(meshoptFile(sheet, spoiled));
        for (const double index : numbersOf(file.commands, "index")) ASSERT_LT(index, sheet.count);
    }
}

#endif

}  // namespace
}  // namespace rtsg
