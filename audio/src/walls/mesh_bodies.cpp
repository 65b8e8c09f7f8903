// Finds closed bodies in a mesh, and the boxes that stand for them.
#include "mesh_bodies.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <unordered_map>
#include <utility>

namespace rtsg {
namespace {

/// Numbers that are joined into groups.
class Groups {
  public:
    std::uint32_t add() {
        first_.push_back(static_cast<std::uint32_t>(first_.size()));
        return first_.back();
    }
    std::uint32_t of(std::uint32_t one) {
        while (first_[one] != one) one = first_[one] = first_[first_[one]];
        return one;
    }
    void join(std::uint32_t a, std::uint32_t b) { first_[of(a)] = of(b); }
    std::size_t size() const { return first_.size(); }

  private:
    std::vector<std::uint32_t> first_;
};

/// Adds the volume between a triangle and `origin`, and its moments about that.
void addTetrahedron(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, MeshBody& sum) {
    const double volume = glm::dot(a, glm::cross(b, c)) / 6;
    const glm::dvec3 all = a + b + c;
    sum.volume += volume;
    sum.center += volume * all / 4.0;
    for (const glm::dvec3& p : {a, b, c, all}) sum.moments += volume / 20 * glm::outerProduct(p, p);
}

/// About the middle, from sums about `origin`.
MeshBody wholeOf(MeshBody sum, const glm::dvec3& origin) {
    if (sum.volume < 0) sum = {-sum.volume, -sum.center, -sum.moments};
    sum.center /= sum.volume;
    sum.moments = sum.moments / sum.volume - glm::outerProduct(sum.center, sum.center);
    sum.center += origin;
    return sum;
}

/// Jacobi's rotations: columns of `axes` are eigenvectors, `values` what is on the diagonal then.
void diagonalize(glm::dmat3 m, glm::dmat3& axes, glm::dvec3& values) {
    axes = glm::dmat3(1.0);
    for (int sweep = 0; sweep < 12; ++sweep)
        for (const auto& [p, q] : {std::pair(0, 1), std::pair(0, 2), std::pair(1, 2)}) {
            // Of what is as wide both ways the axes stay, whatever rounding says.
            if (std::abs(m[p][q]) <= 1e-6 * (std::abs(m[p][p]) + std::abs(m[q][q]))) continue;
            const double angle = 0.5 * std::atan2(2 * m[p][q], m[q][q] - m[p][p]);
            glm::dmat3 turn(1.0);
            turn[p][p] = turn[q][q] = std::cos(angle);
            turn[q][p] = std::sin(angle);
            turn[p][q] = -std::sin(angle);
            m = glm::transpose(turn) * m * turn;
            axes = axes * turn;
        }
    values = {m[0][0], m[1][1], m[2][2]};
}

/// Of a body that is alike along several axes any others would do as well: those of its mesh are those of its faces.
bool alongAxes(const glm::dmat3& turn, const glm::dmat3& moments, glm::dmat3& axes, glm::dvec3& squares) {
    constexpr double kNothing = 1e-6;
    for (int i = 0; i < 3; ++i) {
        const int k = (i + 1) % 3;
        const double length = glm::length(turn[i]), other = glm::length(turn[k]);
        if (!(length > 0) || std::abs(glm::dot(turn[i], turn[k])) > kNothing * length * other ||
            std::abs(moments[i][k]) > kNothing * std::sqrt(moments[i][i] * moments[k][k]))
            return false;
        axes[i] = turn[i] / length;
        squares[i] = moments[i][i] * length * length;
    }
    return true;
}

}  // namespace

bool MeshBodies::Part::reaches(double x) const {
    return x <= high.x + 1e-6 * (1 + std::abs(high.x));
}

bool MeshBodies::Part::meets(const Part& other) const {
    for (int i = 0; i < 3; ++i) {
        const double off = 1e-6 * (1 + std::max(std::abs(high[i]), std::abs(other.high[i])));
        if (low[i] > other.high[i] + off || other.low[i] > high[i] + off) return false;
    }
    return true;
}

void MeshBodies::Part::add(const Part& other) {
    low = glm::min(low, other.low);
    high = glm::max(high, other.high);
    const double sum = all.volume + other.all.volume;
    const glm::dvec3 middle = (all.volume * all.center + other.all.volume * other.all.center) / sum;
    const auto about = [&](const MeshBody& one) {
        const glm::dvec3 off = one.center - middle;
        return one.volume / sum * (one.moments + glm::outerProduct(off, off));
    };
    all = {sum, middle, about(all) + about(other.all)};
}

MeshBody MeshBodies::Part::body() const {
    // Where parts stand in each other their sum may be more than all there is.
    const glm::dvec3 size = high - low;
    const double box = size.x * size.y * size.z;
    if (all.volume < box * (1 - 1e-6)) return {all.volume, all.center, all.moments, low, high};
    MeshBody whole{box, 0.5 * (low + high), glm::dmat3(0.0), low, high};
    for (int i = 0; i < 3; ++i) whole.moments[i][i] = size[i] * size[i] / 12;
    return whole;
}

MeshBodies::MeshBodies(const Mesh& mesh) {
    Groups groups;
    corners_.reserve(mesh.triangleCount);
    std::vector<glm::dvec3> places;
    std::vector<std::uint32_t> numbers;  // of the corners of triangles
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t)
        for (std::uint32_t c = 0; c < 3; ++c) {
            const Vec3f corner = mesh.vertex(t, c) + Vec3f(0);  // there is one zero
            const auto [known, fresh] = corners_.try_emplace(corner, 0);
            if (fresh) {
                known->second = groups.add();
                places.emplace_back(corner);
            }
            numbers.push_back(known->second);
            if (c > 0) groups.join(numbers[numbers.size() - 1], numbers[numbers.size() - 2]);
        }
    // By their ends, the lower number first: how often more that way than the other.
    std::unordered_map<std::uint64_t, int> turns;
    turns.reserve(2 * numbers.size());
    std::vector<MeshBody> sums(groups.size());
    for (std::size_t i = 0; i < numbers.size(); i += 3) {
        for (std::size_t c = 0; c < 3; ++c) {
            const std::uint32_t a = numbers[i + c], b = numbers[i + (c + 1) % 3];
            if (a != b) turns[std::uint64_t{std::min(a, b)} << 32 | std::max(a, b)] += a < b ? 1 : -1;
        }
        // About a corner of it, so that nothing is lost to rounding far from the origin.
        const std::uint32_t group = groups.of(numbers[i]);
        const glm::dvec3& origin = places[group];
        addTetrahedron(places[numbers[i]] - origin, places[numbers[i + 1]] - origin, places[numbers[i + 2]] - origin,
                       sums[group]);
    }
    std::vector<char> closed(groups.size(), 1);
    for (const auto& [ends, turn] : turns)
        if (turn != 0) closed[groups.of(static_cast<std::uint32_t>(ends >> 32))] = 0;
    std::vector<Part> parts;
    std::vector<std::uint32_t> partOf(groups.size(), kNone);
    for (std::uint32_t g = 0; g < groups.size(); ++g) {
        if (groups.of(g) != g || !closed[g] || !(std::abs(sums[g].volume) > 0)) continue;
        partOf[g] = static_cast<std::uint32_t>(parts.size());
        parts.push_back({wholeOf(sums[g], places[g]), places[g], places[g]});
    }
    for (std::uint32_t i = 0; i < places.size(); ++i)
        if (const std::uint32_t part = partOf[groups.of(i)]; part != kNone) parts[part].extend(places[i]);
    const std::vector<std::uint32_t> bodyOf = join(parts);
    for (auto& [corner, number] : corners_)
        number = partOf[groups.of(number)] == kNone ? kNone : bodyOf[partOf[groups.of(number)]];
}

/// What stands in another one, or on it, is one with that; which body each part is of.
std::vector<std::uint32_t> MeshBodies::join(const std::vector<Part>& parts) {
    Groups joined;
    std::vector<std::uint32_t> inOrder;
    for (std::size_t i = 0; i < parts.size(); ++i) inOrder.push_back(joined.add());
    std::ranges::sort(inOrder, {}, [&](std::uint32_t i) { return parts[i].low.x; });
    for (std::size_t i = 0; i < inOrder.size(); ++i)
        for (std::size_t k = i + 1; k < inOrder.size() && parts[inOrder[i]].reaches(parts[inOrder[k]].low.x); ++k)
            if (parts[inOrder[i]].meets(parts[inOrder[k]])) joined.join(inOrder[i], inOrder[k]);
    std::vector<Part> sums(parts.size());
    for (std::uint32_t i = 0; i < parts.size(); ++i) sums[joined.of(i)].add(parts[i]);
    std::vector<std::uint32_t> bodyOf(parts.size(), kNone);
    for (std::uint32_t i = 0; i < parts.size(); ++i) {
        std::uint32_t& body = bodyOf[joined.of(i)];
        if (body == kNone) {
            body = static_cast<std::uint32_t>(bodies_.size());
            bodies_.push_back(sums[joined.of(i)].body());
        }
        bodyOf[i] = body;
    }
    return bodyOf;
}

std::size_t MeshBodies::Hash::operator()(const Vec3f& corner) const {
    std::uint64_t sum = 0;
    for (const float x : {corner.x, corner.y, corner.z}) {
        sum = (sum ^ std::bit_cast<std::uint32_t>(x)) * 0x9E3779B97F4A7C15ull;
        sum ^= sum >> 32;
    }
    return static_cast<std::size_t>(sum);
}

std::uint32_t MeshBodies::at(const Vec3f& corner) const {
    const auto found = corners_.find(corner + Vec3f(0));
    return found == corners_.end() ? kNone : found->second;
}

bool placedBody(const MeshBody& body, const WorldFromLocal& m, WallBody& result) {
    const glm::dmat3 turn(m);
    result.center = m * glm::dvec4(body.center, 1);
    result.volume = std::abs(glm::determinant(turn)) * body.volume;
    glm::dvec3 squares;
    if (!alongAxes(turn, body.moments, result.axes, squares))
        diagonalize(turn * body.moments * glm::transpose(turn), result.axes, squares);
    for (int i = 0; i < 3; ++i) result.size[i] = std::sqrt(std::max(0.0, 12 * squares[i]));
    const double box = result.size.x * result.size.y * result.size.z;
    const glm::dvec3 half = 0.5 * (body.high - body.low);
    const glm::dmat3 worldFromBox(turn[0] * half.x, turn[1] * half.y, turn[2] * half.z);
    result.middle = m * glm::dvec4(0.5 * (body.low + body.high), 1);
    result.boxFromWorld = glm::inverse(worldFromBox);
    result.radius = 0;
    for (const double x : {-1.0, 1.0})
        for (const double y : {-1.0, 1.0})
            result.radius = std::max(result.radius, glm::length(worldFromBox * glm::dvec3(x, y, 1)));
    return result.volume > 0 && box > 0 && glm::determinant(worldFromBox) != 0 &&
           std::isfinite(box + result.volume + glm::length(result.center));
}

}  // namespace rtsg
