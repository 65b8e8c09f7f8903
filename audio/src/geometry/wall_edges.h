// The edges of walls that diffract sound: where two surfaces of a mesh meet, and the rims of surfaces.
//
// Corners at one position are one corner, whatever their normals. Edges at one position are one edge, even of different
// walls: two rims that meet are an edge of both. The work depends on the walls that change; edges are found once a
// mesh.
// Threading: change() alone; the rest are const.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <unordered_map>
#include <vector>

#include <rtsg/audio/acoustic_geometry.h>

#include "walls/walls.h"

namespace rtsg {

struct MeshBody;
struct MeshRound;

/// One edge by its corners in a mesh, and a corner of each surface beside it; twice the same at a rim.
struct MeshEdge {
    Vec3f from{0}, to{0}, besideA{0}, besideB{0};
    std::uint32_t round = kNotRound;  // the MeshRound that it is a part of
    std::uint32_t body = kNoBody;     // the MeshBody

    static constexpr std::uint32_t kNotRound = 0xFFFFFFFF, kNoBody = 0xFFFFFFFF;
};

/// Edges between surfaces that differ by less than this angle (radians) do not diffract.
constexpr double kFlatEdge = 0.1;

/// Meshes with more triangles have no edges: they represent curved surfaces, or are too costly to search.
constexpr std::uint32_t kMaxTrianglesWithEdges = 20'000;

/// Edges that two surfaces share at an angle of `flat` radians at least, and those of one surface alone.
std::vector<MeshEdge> edgesOf(const Mesh& mesh, double flat = kFlatEdge);
/// Radians that the surface turns by there; half a turn at a rim.
double turnAngle(const MeshEdge& edge);

/// In the world; nothing for one that a transform has made a point.
bool placedEdge(const MeshEdge& edge, const WorldFromLocal& worldFromLocal, WallEdge& result);

/// The edges of all walls, by slot.
class EdgeTable {
  public:
    void change(std::uint32_t slot, const Wall& wall);
    void visitBut(std::span<const std::uint32_t> open, const AcousticGeometry::EdgeVisitor& visit) const;
    void visitRoundBut(std::span<const std::uint32_t> open, const AcousticGeometry::RoundVisitor& visit) const;

  private:
    struct Found {
        std::vector<MeshEdge> edges;
        std::vector<MeshRound> rounds;
        std::vector<MeshBody> bodies;
    };
    struct CachedMesh {
        std::weak_ptr<const Mesh> mesh;
        std::shared_ptr<const Found> found;
    };
    static constexpr std::uint32_t kAlone = 0xFFFFFFFF;
    struct Placed {
        WallEdge edge;
        std::uint32_t group = kAlone;
    };
    struct EdgeReference {
        std::uint32_t slot = 0, index = 0;
        auto operator<=>(const EdgeReference&) const = default;
    };

    const Placed& at(const EdgeReference& edge) const { return edges_[edge.slot][edge.index]; }
    void add(std::uint32_t slot, const WallEdge& edge);
    void join(const EdgeReference& edge, const EdgeReference& known);
    void removeAll(std::uint32_t slot);
    void insertEdges(std::uint32_t slot, const Wall& wall, const Found& found);
    std::shared_ptr<const Found> foundIn(const std::shared_ptr<const Mesh>& mesh);
    void visitGroup(const std::vector<EdgeReference>& group, std::span<const std::uint32_t> open,
                    const AcousticGeometry::EdgeVisitor& visit) const;

    std::vector<std::vector<Placed>> edges_;
    std::vector<std::vector<RoundBody>> rounds_;
    std::vector<std::vector<WallBody>> bodies_;  // what edges point to: of a slot all at once
    std::size_t roundCount_ = 0;
    std::vector<std::vector<EdgeReference>> groups_;  // edges at one place, in order
    std::vector<std::uint32_t> unused_;               // of the groups
    std::unordered_map<std::uint64_t, std::vector<EdgeReference>> byMiddle_;
    std::unordered_map<const Mesh*, CachedMesh> meshes_;
    std::size_t meshesAtPurge_ = 0;
};

}  // namespace rtsg
