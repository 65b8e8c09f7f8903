// Seeded random edits of the kind that matter to the hierarchy: groups of all kinds, sharing, re-parenting, switches,
// visibility, local lights, materials and geometry.
#pragma once

#include <random>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

namespace rtsg::test {

class Edits {
  public:
    Edits(Scene& scene, std::uint64_t seed) : scene_(scene), random_(seed) {}

    void step() {
        if (showsBoxes_ && !nodes_.empty() && boxRandom_() % 6 == 0) showBox(nodes_[boxRandom_() % nodes_.size()]);
        switch (nodes_.size() < 400 ? 0 : pick(12)) {
            case 0:
            case 1:
            case 2:
                create();
                break;
            case 3:
                if (nodes_.size() > 450) {
                    const std::size_t i = pick(nodes_.size());
                    (void)scene_.destroyNode(nodes_[i]);
                    nodes_.erase(nodes_.begin() + static_cast<std::ptrdiff_t>(i));
                }
                break;
            case 4:
            case 5:
                if (auto [parent, field] = anyParent(); !nodes_.empty())
                    (void)scene_.insertChild(parent, field, any(), pick(6));
                break;
            case 6: {
                const auto [parent, field] = anyParent();
                (void)scene_.removeChild(parent, field, pick(3));
                break;
            }
            case 7: {
                const auto [parent, field] = anyParent();
                if (parent == scene_.root() && pick(20)) break;  // or little would be left to see
                Array<NodeId> children;
                for (std::size_t i = pick(5); i > 0 && !nodes_.empty(); --i) children.push_back(any());
                (void)scene_.setField(parent, field, children);
                break;
            }
            default:
                set();
                break;
        }
    }
    const std::vector<NodeId>& nodes() const { return nodes_; }
    /// Bounding boxes come and go, too; the other edits stay the same.
    void showBoxes() { showsBoxes_ = true; }

  private:
    void showBox(NodeId id) {
        const NodeType& type = scene_.node(id).type();
        const FieldIndex display = type.findExact("bboxDisplay"), size = type.findExact("bboxSize");
        if (display == kNoField) return;
        (void)scene_.setField(id, display, boxRandom_() % 2 == 0);
        const auto depth = static_cast<float>(boxRandom_() % 3);
        if (boxRandom_() % 6 == 0) (void)scene_.setField(id, size, Vec3f(1, .5f, depth));
    }
    std::size_t pick(std::size_t n) { return random_() % n; }
    float number() { return static_cast<float>(static_cast<int>(pick(2001)) - 1000) / 256.0f; }
    NodeId any() { return nodes_[pick(nodes_.size())]; }
    std::pair<NodeId, FieldIndex> anyParent() {
        for (int tries = 0; tries < 8 && !nodes_.empty() && pick(5); ++tries) {
            const NodeId id = any();
            for (const char* name : {"children", "layers", "body"})
                if (const FieldIndex f = scene_.node(id).type().findExact(name); f != kNoField) return {id, f};
        }
        return {scene_.root(), x3d::RtsgScene::children.index};
    }
    void create() {
        static constexpr TypeIndex kinds[] = {x3d::Transform::type,  x3d::Transform::type,
                                              x3d::Group::type,      x3d::Shape::type,
                                              x3d::Shape::type,      x3d::Box::type,
                                              x3d::Switch::type,     x3d::LOD::type,
                                              x3d::Collision::type,  x3d::Anchor::type,
                                              x3d::Billboard::type,  x3d::Inline::type,
                                              x3d::CADFace::type,    x3d::HAnimSite::type,
                                              x3d::LayerSet::type,   x3d::Layer::type,
                                              x3d::Viewpoint::type,  x3d::DirectionalLight::type,
                                              x3d::PointLight::type, x3d::Sound::type,
                                              x3d::Appearance::type, x3d::AcousticProperties::type,
                                              x3d::Material::type,   x3d::IndexedFaceSet::type,
                                              x3d::Coordinate::type, x3d::TimeSensor::type,
                                              x3d::Shape::type,      x3d::Shape::type,
                                              x3d::Group::type};
        const NodeId id = scene_.createNode(kinds[pick(std::size(kinds))]);
        nodes_.push_back(id);
        if (const auto [parent, field] = anyParent(); pick(4)) (void)scene_.insertChild(parent, field, id, SIZE_MAX);
    }
    void set() {
        if (nodes_.empty()) return;
        const NodeId id = any();
        const Node& n = scene_.node(id);
        const auto is = [&](TypeIndex t) { return n.is(t); };
        const Vec3f v(number(), number(), number());
        const Rotation r{number(), number(), pick(5) ? 1.0f : 0.0f, number()};
        if (is(x3d::Transform::type)) {
            switch (pick(6)) {
                case 0:
                    (void)scene_.set(id, x3d::Transform::rotation, r);
                    break;
                case 1:
                    (void)scene_.set(id, x3d::Transform::scale, v);
                    break;
                case 2:
                    (void)scene_.set(id, x3d::Transform::center, v);
                    break;
                case 3:
                    (void)scene_.set(id, x3d::Transform::scaleOrientation, r);
                    break;
                case 4:
                    (void)scene_.set(id, x3d::Transform::visible, pick(6) != 0);
                    break;
                default:
                    (void)scene_.set(id, x3d::Transform::translation, v);
                    break;
            }
        } else if (is(x3d::HAnimSite::type)) {
            (void)scene_.set(id, x3d::HAnimSite::translation, v);
        } else if (is(x3d::Switch::type)) {
            (void)scene_.set(id, x3d::Switch::whichChoice, static_cast<std::int32_t>(pick(4)) - 1);
        } else if (is(x3d::LayerSet::type)) {
            (void)scene_.set(id, x3d::LayerSet::order, Array<std::int32_t>{0, static_cast<std::int32_t>(pick(3)), 2});
        } else if (is(x3d::Shape::type)) {
            switch (pick(4)) {
                case 0:
                    (void)scene_.setField(id, x3d::Shape::castShadow.index, pick(2) == 0);
                    break;
                case 1:
                    (void)scene_.setField(id, x3d::Shape::visible.index, pick(4) != 0);
                    break;
                case 2:
                    (void)scene_.setField(id, x3d::Shape::appearance.index, ofType(x3d::Appearance::type));
                    break;
                default:
                    (void)scene_.setField(id, x3d::Shape::geometry.index,
                                          ofType(pick(2) ? x3d::Box::type : x3d::IndexedFaceSet::type));
                    break;
            }
        } else if (is(x3d::CADFace::type)) {
            (void)scene_.setField(id, x3d::CADFace::shape.index,
                                  ofType(pick(3) ? x3d::Shape::type : x3d::Transform::type));
        } else if (is(x3d::Appearance::type)) {
            if (pick(2))
                (void)scene_.setField(id, x3d::Appearance::acousticProperties.index,
                                      ofType(x3d::AcousticProperties::type));
            else
                (void)scene_.setField(id, x3d::Appearance::material.index, ofType(x3d::Material::type));
        } else if (is(x3d::DirectionalLight::type)) {
            (void)scene_.set(id, x3d::DirectionalLight::global, pick(3) == 0);
        } else if (is(x3d::PointLight::type)) {
            (void)scene_.set(id, x3d::PointLight::global, pick(3) == 0);
        } else if (is(x3d::Inline::type) && pick(4) == 0) {
            (void)scene_.set(id, x3d::Inline::global, pick(2) == 0);
        } else if (is(x3d::IndexedFaceSet::type)) {
            (void)scene_.setField(id, x3d::IndexedFaceSet::coord.index, ofType(x3d::Coordinate::type));
        } else if (is(x3d::Coordinate::type)) {
            (void)scene_.set(id, x3d::Coordinate::point, Array<Vec3f>{v});
        } else if (is(x3d::Material::type)) {
            (void)scene_.set(id, x3d::Material::diffuseColor, Color{.5f, .25f, 0});
        } else if (const FieldIndex f = n.type().findExact("visible"); f != kNoField) {
            (void)scene_.setField(id, f, pick(6) != 0);
        }
    }
    NodeId ofType(TypeIndex type) {
        for (int tries = 0; tries < 30; ++tries)
            if (const NodeId id = any(); scene_.node(id).is(type)) return id;
        return {};
    }
    Scene& scene_;
    std::mt19937_64 random_, boxRandom_{19775};
    bool showsBoxes_ = false;
    std::vector<NodeId> nodes_;
};

}  // namespace rtsg::test
