// Finds edges by the corners that triangles share.
#include "wall_edges.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "diffraction_parts.h"
#include "round_shapes.h"
#include "straight_edges.h"
#include "walls/mesh_bodies.h"

namespace rtsg {
namespace {

struct Edge {
    Vec3f from, to;  // from before to by x, y and z
    Vec3f besideA, besideB;
    int sides = 0;  // of triangles
};

/// The edges of a mesh by their ends.
class EdgesByEnds {
  public:
    explicit EdgesByEnds(std::size_t sides) : slots_(std::bit_ceil(2 * sides + 1), kNone) { edges_.reserve(sides); }

    void add(const Vec3f& from, const Vec3f& to, const Vec3f& beside) {
        std::size_t at = hash(from, to) & (slots_.size() - 1);
        while (slots_[at] != kNone && (edges_[slots_[at]].from != from || edges_[slots_[at]].to != to))
            at = (at + 1) & (slots_.size() - 1);
        if (slots_[at] == kNone) {
            slots_[at] = static_cast<std::uint32_t>(edges_.size());
            edges_.push_back({from, to, beside, beside});
        }
        Edge& edge = edges_[slots_[at]];
        if (++edge.sides == 2) edge.besideB = beside;
    }
    const std::vector<Edge>& edges() const { return edges_; }

  private:
    static constexpr std::uint32_t kNone = 0xFFFFFFFF;

    static std::size_t hash(const Vec3f& from, const Vec3f& to) {
        std::uint64_t sum = 0;
        for (const float x : {from.x, from.y, from.z, to.x, to.y, to.z}) {
            sum = (sum ^ std::bit_cast<std::uint32_t>(x)) * 0x9E3779B97F4A7C15ull;
            sum ^= sum >> 32;
        }
        return static_cast<std::size_t>(sum);
    }

    std::vector<Edge> edges_;
    std::vector<std::uint32_t> slots_;  // a power of two of them, at most half used
};

/// Unit, square to the axis, from the edge towards a place.
glm::dvec3 acrossTo(const glm::dvec3& position, const glm::dvec3& from, const glm::dvec3& axis) {
    const glm::dvec3 displacement = position - from, across = displacement - axis * glm::dot(displacement, axis);
    const double length = glm::length(across);
    return length > 0 ? across / length : glm::dvec3(0);
}

/// Of both surfaces the direction away from the edge.
double facesDot(const Vec3f& from, const Vec3f& to, const Vec3f& besideA, const Vec3f& besideB) {
    const glm::dvec3 axis = glm::normalize(glm::dvec3(to) - glm::dvec3(from));
    return glm::dot(acrossTo(besideA, from, axis), acrossTo(besideB, from, axis));
}

}  // namespace

double turnAngle(const MeshEdge& edge) {
    return std::acos(std::clamp(-facesDot(edge.from, edge.to, edge.besideA, edge.besideB), -1.0, 1.0));
}

std::vector<MeshEdge> edgesOf(const Mesh& mesh, double flat) {
    std::vector<MeshEdge> result;
    if (mesh.triangleCount > kMaxTrianglesWithEdges) return result;
    EdgesByEnds found(std::size_t{3} * mesh.triangleCount);
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t) {
        // + 0: there is one zero.
        const Vec3f corners[] = {mesh.vertex(t, 0) + Vec3f(0), mesh.vertex(t, 1) + Vec3f(0),
                                 mesh.vertex(t, 2) + Vec3f(0)};
        for (std::uint32_t c = 0; c < 3; ++c) {
            const Vec3f &a = corners[c], &b = corners[(c + 1) % 3], &beside = corners[(c + 2) % 3];
            if (!std::isfinite(a.x + a.y + a.z + b.x + b.y + b.z) || a == b) continue;
            isBefore(b, a) ? found.add(b, a, beside) : found.add(a, b, beside);
        }
    }
    const double maximum = -std::cos(flat);
    for (const Edge& edge : found.edges())
        // There is no wedge where more than two surfaces meet.
        if (edge.sides == 1 ||
            (edge.sides == 2 && !(facesDot(edge.from, edge.to, edge.besideA, edge.besideB) < maximum)))
            result.push_back({edge.from, edge.to, edge.besideA, edge.besideB});
    // Sorted by their ends, so that the order does not depend on the numbers of triangles.
    std::sort(result.begin(), result.end(), [](const MeshEdge& a, const MeshEdge& b) {
        return a.from != b.from ? isBefore(a.from, b.from) : isBefore(a.to, b.to);
    });
    return result;
}

bool placedEdge(const MeshEdge& edge, const WorldFromLocal& m, WallEdge& result) {
    const auto placed = [&](const Vec3f& p) { return m * glm::dvec4(glm::dvec3(p), 1); };
    result.from = placed(edge.from);
    const glm::dvec3 displacement = placed(edge.to) - result.from;
    result.length = glm::length(displacement);
    if (!(result.length > 0) || !std::isfinite(result.length)) return false;
    result.axis = displacement / result.length;
    result.faceA = acrossTo(placed(edge.besideA), result.from, result.axis);
    result.faceB = acrossTo(placed(edge.besideB), result.from, result.axis);
    return glm::dot(result.faceA, result.faceA) > 0.5 && glm::dot(result.faceB, result.faceB) > 0.5;
}

namespace {

glm::dvec3 endOf(const WallEdge& edge) {
    return edge.from + edge.axis * edge.length;
}

double largestPart(const glm::dvec3& position) {
    const glm::dvec3 size = glm::abs(position);
    return std::max({size.x, size.y, size.z});
}

/// The size by which roundings of an edge's places are measured, metres.
double sizeOf(const WallEdge& edge) {
    return 1 + std::max(largestPart(edge.from), largestPart(endOf(edge)));
}
/// Nearer than this, places in numbers of single precision are one.
double rounding(double size) {
    return 2e-6 * size;
}

/// Edges are looked for by their middles, in cubes of some roundings, so that few edges are in one.
std::uint64_t cubeOf(const glm::dvec3& position, double size) {
    int octave = 0;
    std::frexp(size, &octave);
    const double side = std::ldexp(8 * rounding(1), octave);
    auto sum = static_cast<std::uint64_t>(octave);
    for (int i = 0; i < 3; ++i) {
        const double cube = std::clamp(std::floor(position[i] / side), -9e15, 9e15);
        sum = (sum ^ static_cast<std::uint64_t>(static_cast<std::int64_t>(cube))) * 0x9E3779B97F4A7C15ull;
        sum ^= sum >> 29;
    }
    return sum;
}
std::uint64_t cubeOf(const WallEdge& edge) {
    return cubeOf(edge.from + edge.axis * (0.5 * edge.length), sizeOf(edge));
}

/// Calls with the cubes in which an edge at one place with this may be; with some more than once.
template <class Call>
void visitCubesNear(const WallEdge& edge, const Call& call) {
    const double size = sizeOf(edge), off = rounding(size);
    const glm::dvec3 middle = edge.from + edge.axis * (0.5 * edge.length);
    std::uint64_t last = ~cubeOf(edge);
    for (const double as : {size * (1 - 1e-5), size * (1 + 1e-5)})
        for (int i = 0; i < 8; ++i) {
            const glm::dvec3 corner(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
            const std::uint64_t cube = cubeOf(middle + off * corner, as);
            if (cube != last && call(cube)) return;
            last = cube;
        }
}

bool coincide(const WallEdge& a, const WallEdge& b) {
    const double off = rounding(sizeOf(a));
    const auto near = [&](const glm::dvec3& p, const glm::dvec3& q) { return glm::distance(p, q) <= off; };
    return (near(a.from, b.from) && near(endOf(a), endOf(b))) || (near(a.from, endOf(b)) && near(endOf(a), b.from));
}

}  // namespace

void EdgeTable::join(const EdgeReference& edge, const EdgeReference& known) {
    std::uint32_t group = at(known).group;
    if (group == kAlone) {
        if (unused_.empty()) {
            unused_.push_back(static_cast<std::uint32_t>(groups_.size()));
            groups_.emplace_back();
        }
        group = unused_.back();
        unused_.pop_back();
        groups_[group] = {known};
        edges_[known.slot][known.index].group = group;
    }
    std::vector<EdgeReference>& members = groups_[group];
    members.insert(std::upper_bound(members.begin(), members.end(), edge), edge);
    edges_[edge.slot][edge.index].group = group;
}

void EdgeTable::add(std::uint32_t slot, const WallEdge& edge) {
    const EdgeReference reference{slot, static_cast<std::uint32_t>(edges_[slot].size())};
    edges_[slot].push_back({edge});
    visitCubesNear(edge, [&](std::uint64_t cube) {
        const auto found = byMiddle_.find(cube);
        if (found == byMiddle_.end()) return false;
        const auto known =
            std::ranges::find_if(found->second, [&](const EdgeReference& one) { return coincide(edge, at(one).edge); });
        if (known == found->second.end()) return false;
        join(reference, *known);
        return true;
    });
    byMiddle_[cubeOf(edge)].push_back(reference);
}

void EdgeTable::removeAll(std::uint32_t slot) {
    for (std::uint32_t i = 0; i < edges_[slot].size(); ++i) {
        const EdgeReference edge{slot, i};
        const auto cube = byMiddle_.find(cubeOf(at(edge).edge));
        std::erase(cube->second, edge);
        if (cube->second.empty()) byMiddle_.erase(cube);
        const std::uint32_t group = at(edge).group;
        if (group == kAlone) continue;
        std::erase(groups_[group], edge);
        if (groups_[group].size() > 1) continue;
        for (const EdgeReference& last : groups_[group]) edges_[last.slot][last.index].group = kAlone;
        groups_[group].clear();
        unused_.push_back(group);
    }
    edges_[slot].clear();
}

std::shared_ptr<const EdgeTable::Found> EdgeTable::foundIn(const std::shared_ptr<const Mesh>& mesh) {
    CachedMesh& cached = meshes_[mesh.get()];
    // The address may be another mesh's by now.
    if (cached.mesh.lock() == mesh) return cached.found;
    Found found;
    found.edges = edgesOf(*mesh, kFlatFacet);
    const bool mayBeRound = found.edges.size() <= kMaxEdgesOfRounds && diffractionParts().roundBodies;
    if (!mayBeRound) std::erase_if(found.edges, [](const MeshEdge& edge) { return turnAngle(edge) < kFlatEdge; });
    joinStraight(found.edges);
    if (mayBeRound) found.rounds = roundsOf(found.edges);
    const auto isFlat = [](const MeshEdge& edge) {
        return edge.round == MeshEdge::kNotRound && turnAngle(edge) < kFlatEdge;
    };
    if (!std::ranges::all_of(found.edges, isFlat)) {
        MeshBodies bodies(*mesh);
        for (MeshEdge& edge : found.edges) edge.body = bodies.at(edge.from);
        found.bodies = bodies.all();
    }
    std::erase_if(found.edges, isFlat);
    cached = {mesh, std::make_shared<const Found>(std::move(found))};
    return cached.found;
}

void EdgeTable::change(std::uint32_t slot, const Wall& wall) {
    if (slot >= edges_.size()) {
        if (!wall.mesh) return;
        edges_.resize(slot + 1);
        rounds_.resize(slot + 1);
        bodies_.resize(slot + 1);
    }
    removeAll(slot);
    roundCount_ -= rounds_[slot].size();
    rounds_[slot].clear();
    bodies_[slot].clear();
    if (!wall.mesh) return;
    insertEdges(slot, wall, *foundIn(wall.mesh));
    if (meshes_.size() > 2 * meshesAtPurge_ + 64) {
        std::erase_if(meshes_, [](const auto& entry) { return entry.second.mesh.expired(); });
        meshesAtPurge_ = meshes_.size();
    }
}

void EdgeTable::insertEdges(std::uint32_t slot, const Wall& wall, const Found& found) {
    // A body that a transform has made oval is not round any more, so its edges count.
    std::vector<bool> isRound;
    for (const MeshRound& round : found.rounds) {
        RoundBody body;
        isRound.push_back(placedRound(round, wall.worldFromLocal, body));
        if (!isRound.back()) continue;
        body.material = wall.material;
        rounds_[slot].push_back(body);
    }
    roundCount_ += rounds_[slot].size();
    bodies_[slot].resize(found.bodies.size());
    std::vector<const WallBody*> bodyOf;
    for (std::size_t i = 0; i < bodies_[slot].size(); ++i)
        bodyOf.push_back(placedBody(found.bodies[i], wall.worldFromLocal, bodies_[slot][i]) ? &bodies_[slot][i]
                                                                                            : nullptr);
    // Edges of partly round shapes need more data.
    for (const MeshEdge& edge : found.edges)
        if (edge.round != MeshEdge::kNotRound && isRound[edge.round] && edge.body != MeshEdge::kNoBody)
            bodyOf[edge.body] = nullptr;
    for (const MeshEdge& edge : found.edges) {
        if (edge.round != MeshEdge::kNotRound && (isRound[edge.round] || turnAngle(edge) < kFlatEdge)) continue;
        WallEdge placed;
        if (!placedEdge(edge, wall.worldFromLocal, placed)) continue;
        placed.material = wall.material;
        if (edge.body != MeshEdge::kNoBody) placed.body = bodyOf[edge.body];
        add(slot, placed);
    }
}

void EdgeTable::visitGroup(const std::vector<EdgeReference>& group, std::span<const std::uint32_t> open,
                           const AcousticGeometry::EdgeVisitor& visit) const {
    constexpr double kOneFace = 1 - 1e-6;
    std::vector<glm::dvec3> faces;
    const WallEdge* first = nullptr;
    bool alone = true;
    for (const EdgeReference& reference : group) {
        if (std::ranges::find(open, reference.slot) != open.end()) continue;
        const WallEdge& edge = at(reference).edge;
        if (!first) first = &edge;
        alone = alone && edge.body == first->body;
        for (const glm::dvec3& face : {edge.faceA, edge.faceB})
            if (std::ranges::none_of(faces, [&](const glm::dvec3& one) { return glm::dot(one, face) > kOneFace; }))
                faces.push_back(face);
    }
    // There is no wedge where more than two surfaces meet, nor where one goes on in the other.
    if (!first || faces.size() > 2 || (faces.size() == 2 && glm::dot(faces[0], faces[1]) < -std::cos(kFlatEdge)))
        return;
    WallEdge one = *first;
    one.faceA = faces.front();
    one.faceB = faces.back();
    if (!alone) one.body = nullptr;
    visit(one);
}

void EdgeTable::visitRoundBut(std::span<const std::uint32_t> open, const AcousticGeometry::RoundVisitor& visit) const {
    if (roundCount_ == 0) return;
    for (std::uint32_t slot = 0; slot < rounds_.size(); ++slot) {
        if (std::ranges::find(open, slot) != open.end()) continue;
        for (const RoundBody& body : rounds_[slot]) visit(body);
    }
}

void EdgeTable::visitBut(std::span<const std::uint32_t> open, const AcousticGeometry::EdgeVisitor& visit) const {
    for (std::uint32_t slot = 0; slot < edges_.size(); ++slot) {
        if (std::ranges::find(open, slot) != open.end()) continue;
        for (std::uint32_t i = 0; i < edges_[slot].size(); ++i) {
            const Placed& placed = edges_[slot][i];
            if (placed.group == kAlone) {
                visit(placed.edge);
                continue;
            }
            // Uses the first of them that is not open.
            const std::vector<EdgeReference>& group = groups_[placed.group];
            const auto first = std::ranges::find_if(
                group, [&](const EdgeReference& one) { return std::ranges::find(open, one.slot) == open.end(); });
            if (*first == EdgeReference{slot, i}) visitGroup(group, open, visit);
        }
    }
}

}  // namespace rtsg
