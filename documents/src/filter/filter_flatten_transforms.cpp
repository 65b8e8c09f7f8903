// Applies Transforms that nothing moves to the coordinates below them; geometry without coordinates gets one Transform
// in place of several.
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include <glm/glm.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/rotation.h>

#include "commands/document_tree.h"
#include "filter_parts.h"

namespace rtsg::detail {

namespace {

using Matrix = glm::dmat4;

Matrix rotationMatrix(const Rotation& r) {
    const glm::dvec3 axis(r.x, r.y, r.z);
    const double length = glm::length(axis);
    return length == 0 ? Matrix(1) : Matrix(rotationMatrixOf(axis, static_cast<double>(r.angle)));
}

/// A matrix as a translation, a rotation and scales, if it has no shear.
struct Parts {
    glm::dvec3 translation, scale;
    glm::dquat rotation;
};
std::optional<Parts> partsOf(const Matrix& m) {
    glm::dmat3 axes(m);
    Parts parts{glm::dvec3(m[3]), {}, {}};
    for (int i = 0; i < 3; ++i) {
        parts.scale[i] = glm::length(axes[i]);
        if (!(parts.scale[i] > 1e-12) || !std::isfinite(parts.scale[i])) return {};
        axes[i] /= parts.scale[i];
    }
    constexpr double straight = 1e-7;  // far below the precision of a float
    if (std::abs(glm::dot(axes[0], axes[1])) > straight || std::abs(glm::dot(axes[0], axes[2])) > straight ||
        std::abs(glm::dot(axes[1], axes[2])) > straight)
        return {};
    if (glm::determinant(axes) < 0) {
        parts.scale.x = -parts.scale.x;
        axes[0] = -axes[0];
    }
    parts.rotation = glm::normalize(glm::quat_cast(axes));
    return parts;
}

class FlattenTransforms final : public TreeFilter {
  public:
    using TreeFilter::TreeFilter;

    void change() override {
        uses_ = usesIn(0);
        // The Transforms to be looked at, from the outermost inwards; those inside a flattened one are done with it.
        std::vector<Index> waiting{0};
        while (!waiting.empty()) {
            const Index parent = waiting.back();
            waiting.pop_back();
            std::vector<Index> now;
            for (const Index index : std::vector<Index>((*this)[parent].items))
                if (isStill(index) && !countsItsChildren(parent))
                    flatten(index, Matrix(1), now, waiting);
                else
                    keep(index, now, waiting);
            (*this)[parent].items = std::move(now);
        }
    }

  private:
    void keep(Index index, std::vector<Index>& now, std::vector<Index>& waiting) {
        now.push_back(index);
        if ((*this)[index].kind == Kind::node) waiting.push_back(index);
    }
    bool isReferred(const Item& item) const { return !item.def.empty() && uses_.contains(item.def); }
    bool isShared(Index index) const { return isReferred((*this)[index]); }

    /// A CADLayer before X3D 4.0 has a `visible` for each child.
    bool countsItsChildren(Index index) const {
        return std::ranges::any_of((*this)[index].items, [&](Index in) {
            const Item& one = (*this)[in];
            return one.kind == Kind::value && one.field == "visible" && one.value->holds<Array<bool>>();
        });
    }
    /// A Transform that nothing refers to, whose nodes would mean the same without it.
    bool isStill(Index index) const {
        const Item& item = (*this)[index];
        if (item.kind != Kind::node || item.name != "Transform" || isReferred(item)) return false;
        for (const Index in : item.items) {
            const Item& one = (*this)[in];
            if (one.kind == Kind::value)
                if (one.field == "visible" || one.field == "bboxDisplay") return false;
            if (one.kind == Kind::use && one.field != "children") return false;
            if (one.kind == Kind::node) {
                // Lights, sensors, fogs and clip planes count for those beside them.
                const NodeType* type = findBuiltinType(one.name);
                if (one.field != "children" || !type) return false;
                if (type->name != "Shape" && !type->isA("X3DGroupingNode") && type->name != "Inline") return false;
            }
            if (one.kind == Kind::connection) return false;
        }
        return true;
    }
    template <class T>
    T value(const Item& node, std::string_view field, T otherwise) const {
        for (const Index in : node.items) {
            const Item& one = (*this)[in];
            if (one.kind == Kind::value && one.field == field && one.value->holds<T>()) return one.value->as<T>();
        }
        return otherwise;
    }
    /// ISO/IEC 19775-1 V4.0 10.4.4.
    Matrix matrixOf(const Item& node) const {
        const glm::dvec3 translation(value(node, "translation", Vec3f(0))), center(value(node, "center", Vec3f(0))),
            scale(value(node, "scale", Vec3f(1)));
        const Matrix turned = rotationMatrix(value(node, "scaleOrientation", Rotation{}));
        return glm::translate(Matrix(1), translation + center) * rotationMatrix(value(node, "rotation", Rotation{})) *
               turned * glm::scale(Matrix(1), scale) * glm::transpose(turned) * glm::translate(Matrix(1), -center);
    }

    /// Moves the children of the Transform into `now`, in their order, since a USE might otherwise come before its DEF.
    /// Transforms among them are flattened too, without recursion.
    void flatten(Index root, const Matrix& above, std::vector<Index>& now, std::vector<Index>& waiting) {
        struct Open {
            Index transform;
            Matrix matrix;
            std::size_t next;
        };
        const std::string field = (*this)[root].field;
        const std::size_t first = now.size();
        std::vector<Open> open;
        std::vector<Index> rest;  // of the innermost one, the parts that need a Transform
        const auto flush = [&] {
            if (rest.empty()) return;
            for (const Index in : rest)
                if ((*this)[in].kind == Kind::node) waiting.push_back(in);
            now.push_back(
                transform(*partsOf(open.back().matrix), (*this)[open.back().transform], std::exchange(rest, {})));
        };
        const auto begin = [&](Index index, const Matrix& outer) {
            const Matrix all = outer * matrixOf((*this)[index]);
            if (partsOf(all))
                open.push_back({index, all, 0});
            else
                leave(index, outer, now, waiting);
        };
        begin(root, above);
        while (!open.empty()) {
            Open& top = open.back();
            const std::vector<Index>& items = (*this)[top.transform].items;
            if (top.next == items.size()) {
                flush();
                open.pop_back();
                continue;
            }
            const Index in = items[top.next++];
            const Kind kind = (*this)[in].kind;
            if (kind != Kind::node && kind != Kind::use && kind != Kind::comment) continue;
            if (isStill(in)) {
                flush();
                begin(in, Matrix(top.matrix));
            } else if (kind == Kind::comment || (kind == Kind::node && bake(in, top.matrix))) {
                flush();
                now.push_back(in);
            } else {
                rest.push_back(in);
            }
        }
        for (std::size_t i = first; i < now.size(); ++i)
            if ((*this)[now[i]].kind != Kind::comment) (*this)[now[i]].field = field;
    }
    /// A Transform whose product with those above it shears stays, inside one for those above it.
    void leave(Index index, const Matrix& outer, std::vector<Index>& now, std::vector<Index>& waiting) {
        waiting.push_back(index);
        const std::optional<Parts> parts = partsOf(outer);
        if (!parts || outer == Matrix(1)) return now.push_back(index);
        now.push_back(transform(*parts, (*this)[index], {index}));
    }
    Index transform(const Parts& parts, const Item& like, std::vector<Index> children) {
        Item node{.kind = Kind::node, .where = like.where, .end = like.end};
        node.name = "Transform";
        for (const Index child : children) (*this)[child].field = "children";
        const auto set = [&](const char* field, Value value) {
            Item item{.kind = Kind::value, .where = node.where, .end = node.where};
            item.field = field;
            item.value = std::move(value);
            node.items.push_back(add(std::move(item)));
        };
        if (const Rotation rotation = toRotation(parts.rotation); rotation.angle != 0) set("rotation", Value(rotation));
        if (const Vec3f scale(parts.scale); scale != Vec3f(1)) set("scale", Value(scale));
        if (const Vec3f translation(parts.translation); translation != Vec3f(0)) set("translation", Value(translation));
        node.items.insert(node.items.end(), children.begin(), children.end());
        return add(std::move(node));
    }

    // ---- coordinates
    /// Moves the points of a Shape, if they are its own and nothing else depends on where they are.
    bool bake(Index shape, const Matrix& matrix) {
        if ((*this)[shape].name != "Shape" || isShared(shape)) return false;
        Index geometry = 0, appearance = 0;
        for (const Index in : (*this)[shape].items) {
            const Item& item = (*this)[in];
            if (item.kind == Kind::node && item.field == "geometry") geometry = in;
            if (item.kind == Kind::node && item.field == "appearance") appearance = in;
            if (item.kind == Kind::use && item.field == "geometry") return false;
            if (item.kind == Kind::use && item.field == "appearance") appearance = in;
            if (item.kind == Kind::connection || item.field == "bboxCenter") return false;
        }
        if (!geometry || isShared(geometry)) return false;
        const NodeType* type = findBuiltinType((*this)[geometry].name);
        if (!type || type->findExact("coord") == kNoField || type->isA("X3DParametricGeometryNode")) return false;
        Index points = 0, normals = 0;
        bool textured = false;
        for (const Index in : (*this)[geometry].items) {
            const Item& item = (*this)[in];
            if (item.kind == Kind::connection) return false;
            if (item.kind != Kind::node && item.kind != Kind::use) continue;
            if (item.field == "texCoord") {
                textured = true;
            } else if (item.field == "coord" || item.field == "normal") {
                if (item.kind == Kind::use || isShared(in)) return false;
                (item.field == "coord" ? points : normals) = in;
            } else if (item.field != "color" && item.field != "fogCoord" && item.field != "metadata") {
                return false;
            }
        }
        // Texture coordinates that nobody gave follow from the box around the points.
        if (!textured && appearance && mayHaveTexture(appearance)) return false;
        if (!points || (*this)[points].name != "Coordinate") return false;
        if (normals && (*this)[normals].name != "Normal") return false;
        return move(points, normals, geometry, matrix);
    }
    bool mayHaveTexture(Index appearance) const {
        bool result = (*this)[appearance].kind == Kind::use;
        walk(
            appearance,
            [&](Index index) {
                const Item& item = (*this)[index];
                const NodeType* type = item.kind == Kind::node ? findBuiltinType(item.name) : nullptr;
                if (item.kind == Kind::use || (item.kind == Kind::node && (!type || type->isA("X3DTextureNode"))))
                    result = true;
                return true;
            },
            [](Index) {});
        return result;
    }
    Array<Vec3f>* vectors(Index node, std::string_view field, Array<Vec3f>& copy) {
        for (const Index in : (*this)[node].items) {
            Item& one = (*this)[in];
            if (one.kind == Kind::connection) return nullptr;
            if (one.kind != Kind::value || one.field != field || !one.value->holds<Array<Vec3f>>()) continue;
            copy = one.value->as<Array<Vec3f>>();
            return &copy;
        }
        return nullptr;
    }
    void put(Index node, std::string_view field, Array<Vec3f> all) {
        for (const Index in : (*this)[node].items)
            if ((*this)[in].kind == Kind::value && (*this)[in].field == field) {
                (*this)[in].value = Value(std::move(all));
                return;
            }
    }
    bool move(Index points, Index normals, Index geometry, const Matrix& matrix) {
        Array<Vec3f> at, across;
        if (!vectors(points, "point", at)) return false;
        if (normals && !vectors(normals, "vector", across)) return false;
        if (!at.empty())
            for (Vec3f& one : std::span(at.mutableData(), at.size()))
                one = Vec3f(matrix * glm::dvec4(glm::dvec3(one), 1));
        put(points, "point", std::move(at));
        if (normals && !across.empty()) {
            const glm::dmat3 inverse = glm::transpose(glm::inverse(glm::dmat3(matrix)));
            for (Vec3f& one : std::span(across.mutableData(), across.size())) {
                const glm::dvec3 now = inverse * glm::dvec3(one);
                if (const double length = glm::length(now); length > 0) one = Vec3f(now / length);
            }
            put(normals, "vector", std::move(across));
        }
        const NodeType* type = findBuiltinType((*this)[geometry].name);
        if (glm::determinant(glm::dmat3(matrix)) < 0 && type->findExact("ccw") != kNoField) {
            const bool ccw = value((*this)[geometry], "ccw", true);
            auto& items = (*this)[geometry].items;
            std::erase_if(items,
                          [&](Index in) { return (*this)[in].kind == Kind::value && (*this)[in].field == "ccw"; });
            Item item{.kind = Kind::value, .where = (*this)[geometry].where, .end = (*this)[geometry].where};
            item.field = "ccw";
            item.value = Value(!ccw);
            const Index flag = add(std::move(item));
            (*this)[geometry].items.insert((*this)[geometry].items.begin(), flag);
        }
        return true;
    }

    std::unordered_map<std::string, Uses> uses_;
};

}  // namespace

FilterPtr makeFlattenTransforms(DocumentHandler& next) {
    return std::make_unique<FlattenTransforms>(next);
}

}  // namespace rtsg::detail
