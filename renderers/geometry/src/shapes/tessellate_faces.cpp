// IndexedFaceSet: divides polygons into triangles and keeps the source of each corner.
#include <fmt/format.h>

#include "tessellate_detail.h"

namespace rtsg {

using detail::FacePlan;
using detail::PolygonCutter;
using detail::Topology;
using detail::TopologyBuilder;
using detail::warn;

namespace {

/// True when coordIndex reads "a b c -1" throughout, the last -1 maybe missing; `count` is the number of triangles.
bool isTrianglesOnly(const Array<std::int32_t>& index, std::size_t& count) {
    const std::size_t size = index.size();
    if (size < 3 || (size % 4 != 0 && size % 4 != 3)) return false;
    count = (size + 1) / 4;
    const std::size_t ends = size / 4;
    const std::int32_t* data = index.data();
    std::int32_t all = -1;
    for (std::size_t t = 0; t < ends; ++t) all &= data[t * 4 + 3] == -1 ? -1 : 0;
    return all == -1;
}

/// Walks the faces of an index list one by one and cuts them.
class FaceCutter {
  public:
    FaceCutter(Mesh& mesh, const IndexedFaceSetParams& params, TopologyBuilder& builder, FacePlan* plan)
        : mesh_(mesh), index_(params.coordIndex), builder_(builder), plan_(plan) {}

    void run() {
        const std::size_t size = index_.size();
        std::size_t face = 0;
        for (std::size_t i = 0; i < size; ++i) {
            const std::size_t begin = i;
            while (i < size && index_[i] >= 0) ++i;
            if (i < size && index_[i] < -1) ++oddEnds_;
            if (i > begin) addFace(begin, i, face++);
        }
        report();
    }

  private:
    void addFace(std::size_t begin, std::size_t end, std::size_t face) {
        corners_.clear();
        points_.clear();
        for (std::size_t i = begin; i < end; ++i) {
            const auto v = static_cast<std::size_t>(index_[i]);
            if (v >= mesh_.positions.size()) {
                if (outOfRange_++ == 0) firstOutOfRange_ = {face, v};
                return;
            }
            const Vec3f p = mesh_.positions[v];
            if (!detail::usable(p)) {
                ++notFinite_;
                return;
            }
            if (!corners_.empty() && index_[corners_.back()] == index_[i]) continue;
            corners_.push_back(i);
            points_.push_back(p);
        }
        while (corners_.size() > 1 && index_[corners_.back()] == index_[corners_.front()]) corners_.pop_back();
        points_.resize(corners_.size());
        if (corners_.size() < 3) {
            ++degenerate_;
            return;
        }
        if (corners_.size() == 3) {
            flat_ += detail::isFlat(points_[0], points_[1], points_[2]);
            builder_.add(corners_[0], corners_[1], corners_[2], face);
            return;
        }
        const PolygonCutter::Outcome outcome = cutter_.cut(points_, triangles_);
        if (plan_) plan_->add(index_, corners_, triangles_);
        cutAway_ += outcome == PolygonCutter::Outcome::degenerate;
        tooLong_ += outcome == PolygonCutter::Outcome::tooLong;
        crossing_ += outcome == PolygonCutter::Outcome::selfIntersecting;
        for (const auto& [a, b, c] : triangles_)
            builder_.add(corners_[static_cast<std::size_t>(a)], corners_[static_cast<std::size_t>(b)],
                         corners_[static_cast<std::size_t>(c)], face);
    }

    void report() {
        if (plan_) plan_->dependsOnPoints = notFinite_ + cutAway_ + crossing_ + tooLong_ > 0;
        if (outOfRange_)
            warn(mesh_,
                 fmt::format("coordIndex: {} faces left out, first face {}: it refers to point {} of {}", outOfRange_,
                             firstOutOfRange_.first, firstOutOfRange_.second, mesh_.positions.size()));
        if (notFinite_) warn(mesh_, fmt::format("coord: {} faces left out: their points are not finite", notFinite_));
        if (degenerate_ + cutAway_)
            warn(mesh_, fmt::format("coordIndex: {} faces left out: they have no area", degenerate_ + cutAway_));
        if (flat_) warn(mesh_, fmt::format("{} triangles have no area and show nothing", flat_));
        if (crossing_) warn(mesh_, fmt::format("coordIndex: {} faces cross themselves", crossing_));
        if (tooLong_)
            warn(mesh_, fmt::format("coordIndex: {} faces left out: they cross or touch themselves and have too many "
                                    "corners to be cut",
                                    tooLong_));
        if (oddEnds_) warn(mesh_, fmt::format("coordIndex: {} indices below -1 taken as ends of faces", oddEnds_));
    }

    Mesh& mesh_;
    const Array<std::int32_t>& index_;
    TopologyBuilder& builder_;
    FacePlan* plan_;
    PolygonCutter cutter_;
    std::vector<std::size_t> corners_;
    std::vector<Vec3f> points_;
    std::vector<std::array<int, 3>> triangles_;
    std::size_t outOfRange_ = 0, notFinite_ = 0, degenerate_ = 0, cutAway_ = 0, crossing_ = 0, tooLong_ = 0,
                oddEnds_ = 0, flat_ = 0;
    std::pair<std::size_t, std::size_t> firstOutOfRange_;
};

}  // namespace

Mesh tessellate(const IndexedFaceSetParams& params) {
    return detail::tessellateFaces(params, nullptr);
}

Mesh detail::tessellateFaces(const IndexedFaceSetParams& params, FacePlan* plan) {
    Mesh mesh;
    mesh.solid = params.solid;
    if (params.coordIndex.empty()) return mesh;
    if (params.coord.empty()) {
        warn(mesh, "coordIndex refers to points, and there are none");
        return mesh;
    }
    mesh.positions = params.coord;

    Topology topology;
    std::size_t count = 0;
    if (params.ccw && isTrianglesOnly(params.coordIndex, count) &&
        detail::scanTriangles(mesh.positions, params.coordIndex.data(), 4, count, mesh.bounds)) {
        mesh.triangles = params.coordIndex;
        mesh.triangleStride = 4;
        mesh.triangleCount = static_cast<std::uint32_t>(count);
        detail::reportOfFlatTriangles(mesh);
    } else {
        TopologyBuilder builder(params.coordIndex, params.ccw);
        const bool faceColors = !params.colorPerVertex && (!params.color.empty() || !params.colorRGBA.empty());
        const bool faceNormals = !params.normalPerVertex && (!params.normal.empty() || !params.tangent.empty());
        builder.reserve(params.coordIndex.size() / 4 + 1, faceColors || faceNormals);
        FaceCutter(mesh, params, builder, plan).run();
        topology = builder.finish(mesh);
    }
    if (mesh.empty()) return mesh;
    detail::bindAttributes(mesh, topology, params, {params.colorIndex, params.normalIndex, params.texCoordIndex});
    if (!mesh.normals.present())
        mesh.normals = detail::generateNormals(mesh, detail::checkedCreaseAngle(mesh, params.creaseAngle));
    return mesh;
}

}  // namespace rtsg
