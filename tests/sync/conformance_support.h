// Shared by the makers and readers of the conformance set: things that move, and a whole scene as JSON.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/core/field_text.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

namespace rtsg::test {

inline std::string jsonText(std::string_view text) {
    return printFieldText(Value(String(text)), TextSyntax::json);
}

/// All that is not a default, node by node, as JSON.
inline std::string dumpOf(const Scene& scene) {
    std::string nodes;
    std::vector<std::string> routes;
    scene.forEachNode([&](const Node& node) {
        std::string fields;
        for (FieldIndex i = 0; i < node.type().fields.size(); ++i) {
            const FieldDef& def = node.type().fields[i];
            if (!def.readable() || node.isDefault(i)) continue;
            fields += fmt::format("{}{}:{}", fields.empty() ? "" : ",", jsonText(def.name),
                                  printFieldText(node.value(i), TextSyntax::json));
        }
        const std::string name(scene.name(node.id()));
        nodes +=
            fmt::format("{}\n\"{}\":{{\"type\":{}{}{},\"fields\":{{{}}}}}", nodes.empty() ? "" : ",", node.id().value,
                        jsonText(node.type().name), name.empty() ? "" : ",\"name\":" + jsonText(name),
                        node.scope() ? fmt::format(",\"scope\":{}", node.scope().value) : "", fields);
        for (const Route& r : scene.routesFrom(node.id()))
            routes.push_back(fmt::format("{} {}.{} TO {}.{}", r.isConnection ? "IS" : "ROUTE", r.fromNode.value,
                                         node.type().fields[r.fromField].name, r.toNode.value,
                                         scene.node(r.toNode).type().fields[r.toField].name));
    });
    std::ranges::sort(routes);
    std::string list;
    for (const std::string& route : routes) list += (list.empty() ? "" : ",") + jsonText(route);
    return fmt::format("{{\"state\":{},\"hash\":\"{}\",\"nodes\":{{{}\n}},\n\"routes\":[{}]}}", scene.sequence(),
                       scene.hash().hex(), nodes, list);
}

/// Things that move smoothly, jump, rest, and go through what is no number.
class MovingNodes {
  public:
    explicit MovingNodes(Scene& scene) : scene_(scene) {
        for (int i = 0; i < 10; ++i) {
            nodes_.push_back(scene.createNode(x3d::Transform::type));
            EXPECT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, nodes_.back()));
        }
        light_ = scene.createNode(x3d::PointLight::type);
        EXPECT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, light_));
    }
    void frame(int k, bool odd) {
        const auto t = static_cast<float>(k) / 20;
        for (std::size_t i = 0; i < nodes_.size(); ++i) {
            const auto phase = static_cast<float>(i);
            if (i % 3 == 1 && k % 8 > 4) continue;  // it rests
            const float jump = (k + static_cast<int>(i)) % 11 == 0 ? 5.f : 0.f;
            set(nodes_[i], x3d::Transform::translation,
                Vec3f(std::sin(t + phase) + jump, t * t, static_cast<float>(i) / 3));
            const float x = std::sin(phase), z = std::cos(phase);
            set(nodes_[i], x3d::Transform::rotation, Rotation{x, 0, z, t * phase});
            if (i % 4 == 0) set(nodes_[i], x3d::Transform::scale, Vec3f(1 + t, 1, k % 2 ? -0.f : 1.f));
        }
        set(light_, x3d::PointLight::intensity, .5f + .5f * std::cos(t));
        set(light_, x3d::PointLight::color, Color{t - std::floor(t), .25f, 0});
        if (odd && k % 7 == 3)
            set(nodes_[0], x3d::Transform::translation,
                Vec3f(std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN(), -0.f));
        if (k == 20) {
            EXPECT_TRUE(scene_.destroyNode(nodes_[9]));
            nodes_.pop_back();
        }
    }

  private:
    template <class T>
    void set(NodeId node, Field<T> field, T value) {
        EXPECT_TRUE(scene_.set(node, field, value));
    }
    Scene& scene_;
    std::vector<NodeId> nodes_;
    NodeId light_;
};

}  // namespace rtsg::test
