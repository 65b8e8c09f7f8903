// A rasteriser that draws nothing and writes down what it is told, and a follower of a scene that tells it.
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/renderers/shared_world.h>

#include "raster/raster_module.h"
#include "raster/raster_scene.h"

namespace rtsg::test {

class WrittenRaster final : public RasterModule {
  public:
    struct Mesh {
        std::string text;
        int set = 0, bent = 0;  // how often
        std::vector<RasterVertex> vertices;
        std::vector<RasterLook> looks;
        std::vector<RasterStroke> strokes;
        std::vector<std::uint32_t> indices;
    };
    std::map<std::uint32_t, Mesh> meshes;
    std::map<std::uint32_t, std::string> textures;
    std::map<std::uint32_t, RasterMaterial> materials;
    std::map<std::uint32_t, RasterObject> objects;
    RasterTables tables;
    int wrong = 0;  // numbers that it was told of and does not know

    std::string driver() const override { return "paper"; }
    void run(const std::function<void()>& work) override { work(); }
    std::string problem() override { return {}; }
    void setMesh(std::uint32_t number, const RasterMesh& mesh) override {
        Mesh& held = meshes[number];
        ++held.set;
        held.vertices.assign(mesh.vertices.begin(), mesh.vertices.end());
        held.looks.assign(mesh.looks.begin(), mesh.looks.end());
        held.strokes.assign(mesh.strokes.begin(), mesh.strokes.end());
        held.indices.assign(mesh.indices.begin(), mesh.indices.end());
        write(held);
    }
    void bendMesh(std::uint32_t number, const RasterMesh& mesh) override {
        wrong += !meshes.contains(number);
        Mesh& held = meshes[number];
        ++held.bent;
        wrong += mesh.vertices.size() != held.vertices.size() || !mesh.indices.empty();
        held.vertices.assign(mesh.vertices.begin(), mesh.vertices.end());
        if (!mesh.looks.empty()) held.looks.assign(mesh.looks.begin(), mesh.looks.end());
        write(held);
    }
    void dropMesh(std::uint32_t number) override {
        wrong += meshes.erase(number) != 1;
        for (const auto& [id, item] : objects) wrong += item.mesh == number;
    }
    void setTexture(std::uint32_t number, const RasterTexture& texture) override {
        std::string& text = textures[number] = fmt::format("{} {}:", texture.levels.size(), texture.decoded);
        if (!texture.levels.empty())
            for (const std::uint32_t pixel : texture.levels[0].bytes) text += fmt::format("{:x} ", pixel);
    }
    void dropTexture(std::uint32_t number) override { wrong += textures.erase(number) != 1; }
    void setMaterial(std::uint32_t number, const RasterMaterial& material) override {
        for (const RasterUse& use : material.uses) wrong += use.texture != 0 && !textures.contains(use.texture);
        materials[number] = material;
    }
    void dropMaterial(std::uint32_t number) override {
        wrong += materials.erase(number) != 1;
        for (const auto& [id, item] : objects) wrong += item.material == number;
    }
    void setItem(std::uint32_t number, const RasterObject& object) override {
        wrong += !meshes.contains(object.mesh) || !materials.contains(object.material);
        objects[number] = object;
    }
    void moveItem(std::uint32_t number, const glm::mat3& linear, const glm::vec3& position, bool mirrored) override {
        wrong += !objects.contains(number);
        RasterObject& object = objects[number];
        object.linear = linear, object.position = position, object.mirrored = mirrored;
    }
    void dropItem(std::uint32_t number) override { wrong += objects.erase(number) != 1; }
    void setTables(const RasterTables& to) override { tables = to; }
    void draw(int, int, const std::vector<RasterView>&, std::vector<glm::vec4>&) override {}
    void drawNumbers(int, int, const RasterView&, std::vector<glm::vec4>&) override {}

    /// The drawn content as words that do not depend on numbers or on the order in which it came.
    std::vector<std::string> content(const Vec3d& origin) const {
        std::vector<std::string> all;
        for (const auto& [id, t] : objects) {
            std::string text = fmt::format("{} {} {}{}{}{}{}{}{} ", meshes.at(t.mesh).text, t.layer, t.fronts, t.backs,
                                           t.first, t.mirrored, t.colored, t.alphaColored, t.fogged);
            text += textOf(t.linear[0]) + textOf(t.linear[1]) + textOf(t.linear[2]);
            text += textOf(Vec3f(Vec3d(t.position) + origin)) + textOf(materials.at(t.material)) +
                    textAt(t.surroundings, origin);
            all.push_back(std::move(text));
        }
        std::ranges::sort(all);
        return all;
    }

  private:
    /// Corner by corner, whatever vertices they share; of a large mesh a sum of that.
    static void write(Mesh& mesh) {
        mesh.text = fmt::format("{} {}:", mesh.indices.size(), mesh.strokes.size());
        if (mesh.indices.size() > 60 && mesh.strokes.empty()) {
            std::uint64_t sum = 0;
            const auto add = [&](const glm::vec3& v) {
                for (int k = 0; k < 3; ++k) sum = sum * 1099511628211u + std::uint64_t(std::lround(v[k] * 1024));
            };
            for (const std::uint32_t i : mesh.indices) {
                add(mesh.vertices.at(i).position), add(mesh.vertices.at(i).normal), add(mesh.looks.at(i).coordinates);
                add(glm::vec3(mesh.looks.at(i).color));
            }
            mesh.text += fmt::format("{:x}", sum);
            return;
        }
        for (const RasterStroke& v : mesh.strokes) mesh.text += textOf(v.start) + textOf(v.end);
        if (!mesh.strokes.empty()) return;
        for (const std::uint32_t i : mesh.indices)
            mesh.text += textOf(mesh.vertices.at(i).position) + textOf(mesh.vertices.at(i).normal) +
                         textOf(mesh.looks.at(i).coordinates) + textOf(glm::vec3(mesh.looks.at(i).color));
    }
    static std::string textOf(const glm::vec3& v) {
        const auto rounded = [](float x) { return std::round(x * 1024) / 1024 + 0.0f; };
        return fmt::format("({:g} {:g} {:g})", rounded(v.x), rounded(v.y), rounded(v.z));
    }
    std::string textOf(const RasterMaterial& m) const {
        std::string text =
            fmt::format("model {} clear {} opacity {:g} ", static_cast<int>(m.model), m.clear, m.opacity);
        text += textOf(m.base) + textOf(m.specular) + textOf(m.emissive);
        for (const RasterUse& use : m.uses)
            if (use.texture != 0) text += textures.at(use.texture);
        return text;
    }
    std::string textAt(std::uint32_t surroundings, const Vec3d& origin) const {
        if (surroundings >= tables.surroundings.size()) return "nowhere";
        const RasterSurroundings& around = tables.surroundings[surroundings];
        std::vector<std::string> lights;
        for (const std::uint32_t light : around.lights) {
            const RasterLight& l = tables.lights.at(light);
            lights.push_back(fmt::format("light {} ", l.kind) + textOf(l.color) +
                             textOf(Vec3f(Vec3d(l.position) + origin)) + textOf(l.direction));
        }
        std::ranges::sort(lights);
        std::string text = fmt::format("fog {} {:g} ", around.fogType, around.fogRange);
        for (const std::string& light : lights) text += light;
        return text;
    }
};

/// Follows a world for such a rasteriser.
class Written final : public InstanceSubscriber {
  public:
    explicit Written(SharedWorld& w) : world(w) {
        scene.open(&raster);
        world.add(*this);
    }
    ~Written() override { world.remove(*this); }
    Result<> apply(const Scene& from, const ChangeSet& changes, const InstanceDelta& delta) override {
        if (auto ok = tables.apply(from, changes, delta); !ok) return ok;
        scene.follow(delta);
        return {};
    }
    /// The content of a picture.
    std::vector<std::string> content() {
        const SurfaceState state = tables.latest();
        const BoxOfLayer boxes = [this](std::uint16_t layer) { return scene.box(layer); };
        const auto camera = state.camera(boxes, 1);
        EXPECT_TRUE(camera);
        scene.bring(state, state.layers(boxes, *camera, 64, 64), camera->position);
        EXPECT_EQ(raster.wrong, 0);
        return raster.content(scene.origin());
    }

    SharedWorld& world;
    SurfaceTables tables;
    WrittenRaster raster;  // outlives what is handed to it
    std::vector<std::string> lacks;
    RasterScene scene{[this](const char* what) { lacks.emplace_back(what); }};
};

}  // namespace rtsg::test
