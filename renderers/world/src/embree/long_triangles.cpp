// Finds triangles whose boxes are far greater than they are, and cuts their edges into equal parts.
#include "long_triangles.h"

#include <array>
#include <bit>
#include <cmath>
#include <map>
#include <utility>

namespace rtsg::bvh {

namespace {

/// From this value on a box counts as empty: half its surface divided by the area of the triangle seen along the axes.
/// The value is 2 for half a rectangle along the axes, and hardly above 4 for any triangle that is not long.
constexpr double kEmptyBox = 6;
/// Rays that meet the mesh's box should meet so many empty ones at most; and some more before anything is done.
constexpr double kFewEmpty = 2, kManyEmpty = 6;
/// The largest share of the boxes' surface that cutting may leave to be worth its memory.
constexpr double kCutPays = .7;
/// Pieces for each triangle, and for each with an empty box (of all of them: the last), at most.
constexpr double kMaxPieces = 1, kMaxPiecesOfLong = 64, kMaxPiecesOfAllLong = 1 << 20;
/// An edge becomes 2 to this many parts at most.
constexpr int kMaxLevels = 8;
constexpr std::uint32_t kNowhere = 0xFFFFFFFF;

/// Half the surface of the box of an edge.
double edgeBox(const Vec3d& d) {
    return std::abs(d.x * d.y) + std::abs(d.y * d.z) + std::abs(d.z * d.x);
}

struct TriangleSize {
    double box = 0, covered = 0;
    bool isEmpty() const { return covered > 0 && box > kEmptyBox * covered; }
};

TriangleSize triangleSize(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    const Vec3d size = glm::max(glm::max(a, b), c) - glm::min(glm::min(a, b), c);
    const Vec3d normal = glm::abs(glm::cross(b - a, c - a));
    return {size.x * size.y + size.y * size.z + size.z * size.x, .5 * (normal.x + normal.y + normal.z)};
}

std::uint64_t scattered(std::uint64_t x) {
    x ^= x >> 31, x *= 0x9E3779B97F4A7C15;
    return x ^ x >> 29;
}

/// Edges by the numbers of their ends: open addressing, entries in the order in which they came.
class EdgeTable {
  public:
    struct Edge {
        std::uint64_t key;
        std::uint32_t opposite = kNowhere;  // the corner there of whoever came first
        std::uint32_t first = kNowhere;     // of the points between its ends, from the lower number on
        bool isShared = false, isDead = false;
        int level = 0;  // 2 to this many parts
        /// A triangle that is there twice is one.
        void addUser(std::uint32_t corner) {
            isShared |= opposite != kNowhere && opposite != corner;
            if (opposite == kNowhere) opposite = corner;
        }
        std::uint32_t low() const { return static_cast<std::uint32_t>(key >> 32); }
        std::uint32_t high() const { return static_cast<std::uint32_t>(key); }
    };
    std::vector<Edge> edges;

    std::uint32_t find(std::uint32_t a, std::uint32_t b) const {
        const std::uint64_t key = keyOf(a, b);
        if (slots_.empty()) return kNowhere;
        for (std::size_t i = scattered(key);; ++i) {
            const std::uint32_t at = slots_[i & (slots_.size() - 1)];
            if (at == kNowhere || edges[at].key == key) return at;
        }
    }
    std::uint32_t findOrAdd(std::uint32_t a, std::uint32_t b) {
        if (const std::uint32_t at = find(a, b); at != kNowhere) return at;
        edges.push_back({keyOf(a, b)});
        if (2 * edges.size() > slots_.size()) {
            slots_.assign(std::max<std::size_t>(64, 4 * std::bit_ceil(edges.size())), kNowhere);
            for (std::uint32_t i = 0; i < edges.size(); ++i) put(i);
        } else {
            put(static_cast<std::uint32_t>(edges.size() - 1));
        }
        return static_cast<std::uint32_t>(edges.size() - 1);
    }

  private:
    static std::uint64_t keyOf(std::uint32_t a, std::uint32_t b) {
        return std::uint64_t{std::min(a, b)} << 32 | std::max(a, b);
    }
    void put(std::uint32_t edge) {
        std::size_t i = scattered(edges[edge].key);
        while (slots_[i & (slots_.size() - 1)] != kNowhere) ++i;
        slots_[i & (slots_.size() - 1)] = edge;
    }
    std::vector<std::uint32_t> slots_;
};

class Cutter {
  public:
    Cutter(const Mesh& mesh, const Array<Vec3f>& positions) : mesh_(mesh), positions_(positions) {}

    /// Whether rays meet so many empty boxes that it may pay.
    bool measure();
    /// Null if it did not.
    std::shared_ptr<const LongTriangles> cut();

  private:
    /// A triangle with edges that may be cut, and those; kNowhere: too short.
    struct Touched {
        std::uint32_t triangle;
        std::array<std::uint32_t, 3> corner, edge;
    };
    /// On the triangle that is being cut.
    struct Uv {
        float u, v;
        friend auto operator<=>(const Uv&, const Uv&) = default;
    };

    Vec3d at(std::uint32_t corner) const {
        return corner < positions_.size() ? Vec3d(positions_[corner]) : added_[corner - positions_.size()];
    }
    std::uint32_t corner(std::uint32_t triangle, int k) const {
        return static_cast<std::uint32_t>(mesh_.triangles[std::size_t{triangle} * mesh_.triangleStride + k]);
    }
    std::array<Vec3d, 3> cornersOf(std::uint32_t triangle) const {
        return {at(corner(triangle, 0)), at(corner(triangle, 1)), at(corner(triangle, 2))};
    }
    void findSame();
    int wantedLevel(const TriangleSize& size, double edge, double minimum) const;
    double chooseSmallest() const;
    void touch(std::uint32_t triangle, double minimum, bool isEmpty);
    void killEdges();
    void cutEdges();
    void cutTriangle(const Touched& touched);

    std::uint32_t numberOf(const Uv& uv);
    void divide(const std::array<Uv, 3>& p, const std::array<int, 3>& levels);
    void zip(const Uv& apex, const Uv& b, const Uv& c, int levelB, int levelC);
    void emit(const Uv& a, const Uv& b, const Uv& c);

    const Mesh& mesh_;
    const Array<Vec3f>& positions_;
    std::vector<std::uint32_t> long_;  // triangles with empty boxes
    std::vector<std::uint32_t> same_;  // by point: the first one there
    EdgeTable table_;
    std::vector<Touched> touched_;
    std::vector<Vec3d> added_;
    const Touched* now_ = nullptr;
    std::map<Uv, std::uint32_t> inside_;  // of the triangle that is being cut
    std::vector<LongTriangles::Piece> pieces_;
    std::vector<std::int32_t> pieceCorners_;
    double meshBox_ = 0, longestBox_ = 0, boxes_ = 0, emptyBoxes_ = 0, replaced_ = 0, replacing_ = 0;
};

bool Cutter::measure() {
    Vec3d low(HUGE_VAL), high(-HUGE_VAL);
    for (std::uint32_t i = 0; i < mesh_.triangleCount; ++i) {
        const auto [a, b, c] = cornersOf(i);
        const TriangleSize size = triangleSize(a, b, c);
        boxes_ += size.box;
        if (size.isEmpty()) {
            emptyBoxes_ += size.box;
            longestBox_ = std::max({longestBox_, edgeBox(b - a), edgeBox(c - b), edgeBox(a - c)});
            long_.push_back(i);
        }
        low = glm::min(low, glm::min(glm::min(a, b), c)), high = glm::max(high, glm::max(glm::max(a, b), c));
    }
    const Vec3d size = high - low;
    meshBox_ = size.x * size.y + size.y * size.z + size.z * size.x;
    return meshBox_ > 0 && emptyBoxes_ > kManyEmpty * meshBox_ && emptyBoxes_ > (1 - kCutPays) * boxes_;
}

/// Meshes often have a point once for each triangle; points at the same place are the same here.
void Cutter::findSame() {
    const std::size_t count = positions_.size(), positions = 2 * std::bit_ceil(count + 1);
    std::vector<std::uint32_t> table(positions, kNowhere);
    same_.resize(count);
    for (std::uint32_t i = 0; i < count; ++i) {
        const Vec3f p = positions_[i] + Vec3f(0);  // -0 is 0
        const auto bits = [](float x) { return std::uint64_t{std::bit_cast<std::uint32_t>(x)}; };
        std::size_t k = scattered(bits(p.x) ^ scattered(bits(p.y) ^ scattered(bits(p.z))));
        while (table[k & (positions - 1)] != kNowhere && positions_[table[k & (positions - 1)]] != p) ++k;
        std::uint32_t& slot = table[k & (positions - 1)];
        if (slot == kNowhere) slot = i;
        same_[i] = slot;
    }
}

/// Parts of an edge have boxes of `least` at most, and no more parts than fill the triangle's box: n pieces along it
/// have an n-th of the emptiness, doubled.
int Cutter::wantedLevel(const TriangleSize& size, double edge, double minimum) const {
    const double parts = std::min(std::sqrt(edge / minimum), 2 * size.box / (kEmptyBox * size.covered));
    return parts > 1 ? std::min(static_cast<int>(std::ceil(std::log2(parts))), kMaxLevels) : 0;
}

/// The greatest box of an edge's part that leaves few empty boxes, or as many pieces as there may be.
double Cutter::chooseSmallest() const {
    const double maximum = kMaxPieces * mesh_.triangleCount +
                           std::min(kMaxPiecesOfLong * static_cast<double>(long_.size()), kMaxPiecesOfAllLong);
    double chosen = longestBox_;
    for (double minimum = longestBox_ / 4; minimum > 0; minimum /= 4) {
        double pieces = 0, boxes = 0;
        int highest = 0;
        for (const std::uint32_t triangle : long_) {
            const auto [a, b, c] = cornersOf(triangle);
            const TriangleSize size = triangleSize(a, b, c);
            std::array<int, 3> levels{wantedLevel(size, edgeBox(b - a), minimum),
                                      wantedLevel(size, edgeBox(c - b), minimum),
                                      wantedLevel(size, edgeBox(a - c), minimum)};
            std::ranges::sort(levels);
            const double count = std::exp2(levels[2]) * (1 + std::exp2(levels[0])) - 1;
            pieces += count, boxes += size.box * count / std::exp2(2 * levels[2]);
            highest = std::max(highest, levels[2]);
        }
        if (pieces > maximum) break;
        chosen = minimum;
        if (boxes < kFewEmpty * meshBox_ || highest == kMaxLevels) break;
        // Once every triangle has what fills its box, nothing more comes.
        if (minimum < longestBox_ * std::exp2(-2 * kMaxLevels)) break;
    }
    return chosen;
}

/// Those with empty boxes say which edges to cut, and how; their neighbours go along.
void Cutter::touch(std::uint32_t triangle, double minimum, bool isEmpty) {
    Touched touched{triangle, {}, {kNowhere, kNowhere, kNowhere}};
    const auto p = cornersOf(triangle);
    std::array<double, 3> boxes;
    double longest = 0;
    for (int k = 0; k < 3; ++k) longest = std::max(longest, boxes[k] = edgeBox(p[(k + 1) % 3] - p[k]));
    if (longest <= minimum) return;
    for (int k = 0; k < 3; ++k) touched.corner[k] = same_[corner(triangle, k)];
    bool any = false;
    for (int k = 0; k < 3; ++k) {
        if (boxes[k] <= minimum) continue;
        const std::uint32_t a = touched.corner[k], b = touched.corner[(k + 1) % 3];
        const std::uint32_t at = touched.edge[k] = isEmpty ? table_.findOrAdd(a, b) : table_.find(a, b);
        if (at == kNowhere) continue;
        EdgeTable::Edge& edge = table_.edges[at];
        edge.addUser(touched.corner[(k + 2) % 3]);
        if (isEmpty) edge.level = std::max(edge.level, wantedLevel(triangleSize(p[0], p[1], p[2]), boxes[k], minimum));
        any = true;
    }
    if (any) touched_.push_back(touched);
}

/// An edge of one triangle alone stays; then so must all edges of a triangle whose long ones cannot all be cut, or its
/// pieces would be as long as it is. Cases that are left after a few sweeps only cost speed.
void Cutter::killEdges() {
    for (EdgeTable::Edge& edge : table_.edges) edge.isDead = !edge.isShared;
    const auto spread = [&](const Touched& touched) {
        std::array<double, 3> boxes;
        for (int k = 0; k < 3; ++k) boxes[k] = edgeBox(at(touched.corner[(k + 1) % 3]) - at(touched.corner[k]));
        const double longest = std::max({boxes[0], boxes[1], boxes[2]});
        bool any = false, all = true;
        for (int k = 0; k < 3; ++k) {
            if (touched.edge[k] == kNowhere) continue;
            any |= table_.edges[touched.edge[k]].isDead && 2 * boxes[k] >= longest;
            all &= table_.edges[touched.edge[k]].isDead;
        }
        if (!any || all) return false;
        for (const std::uint32_t edge : touched.edge)
            if (edge != kNowhere) table_.edges[edge].isDead = true;
        return true;
    };
    for (int sweep = 0; sweep < 16; ++sweep) {
        bool changed = false;
        for (const Touched& touched : touched_) changed |= spread(touched);
        for (std::size_t i = touched_.size(); i-- > 0;) changed |= spread(touched_[i]);
        if (!changed) return;
    }
}

void Cutter::cutEdges() {
    for (EdgeTable::Edge& edge : table_.edges) {
        if (edge.isDead) edge.level = 0;
        if (edge.level == 0) continue;
        edge.first = static_cast<std::uint32_t>(positions_.size() + added_.size());
        const Vec3d a = at(edge.low()), along = at(edge.high()) - a;
        const int parts = 1 << edge.level;
        for (int i = 1; i < parts; ++i) added_.push_back(a + along * (static_cast<double>(i) / parts));
    }
}

/// The point at a place of the triangle: a corner, one that its neighbour has, too, or one of its own.
std::uint32_t Cutter::numberOf(const Uv& uv) {
    const auto [u, v] = uv;
    const float w = 1 - u - v;  // exact, as all of them are
    const auto& corner = now_->corner;
    const auto onEdge = [&](int k, float along) {
        if (along == 0) return corner[k];
        if (along == 1) return corner[(k + 1) % 3];
        const EdgeTable::Edge& edge = table_.edges[now_->edge[k]];
        const auto parts = static_cast<std::uint32_t>(1 << edge.level);
        const auto i = static_cast<std::uint32_t>(along * static_cast<float>(parts));
        return edge.first + (corner[k] == edge.low() ? i : parts - i) - 1;
    };
    if (v == 0) return onEdge(0, u);
    if (w == 0) return onEdge(1, v);
    if (u == 0) return onEdge(2, w);
    const auto [found, isNew] = inside_.try_emplace(uv, static_cast<std::uint32_t>(positions_.size() + added_.size()));
    if (isNew) added_.push_back(double{w} * at(corner[0]) + double{u} * at(corner[1]) + double{v} * at(corner[2]));
    return found->second;
}

void Cutter::emit(const Uv& a, const Uv& b, const Uv& c) {
    const std::array<std::uint32_t, 3> corners{numberOf(a), numberOf(b), numberOf(c)};
    replacing_ += triangleSize(at(corners[0]), at(corners[1]), at(corners[2])).box;
    for (const std::uint32_t corner : corners) pieceCorners_.push_back(static_cast<std::int32_t>(corner));
    const auto [p, q, r] = cornersOf(now_->triangle);
    pieces_.push_back({now_->triangle, {a.u, b.u, c.u}, {a.v, b.v, c.v}, Vec3f(glm::cross(q - p, r - p))});
}

/// Pieces between two edges that are cut: from their common end to the third, which is not.
void Cutter::zip(const Uv& apex, const Uv& b, const Uv& c, int levelB, int levelC) {
    const int countB = 1 << levelB, countC = 1 << levelC;
    const auto along = [&](const Uv& end, int i, int count) {
        const float t = static_cast<float>(i) / static_cast<float>(count);
        return Uv{apex.u + t * (end.u - apex.u), apex.v + t * (end.v - apex.v)};
    };
    const auto squared = [&](const Uv& p, const Uv& q) {
        const Vec3d d = at(numberOf(q)) - at(numberOf(p));
        return glm::dot(d, d);
    };
    int i = 1, j = 1;
    emit(apex, along(b, 1, countB), along(c, 1, countC));
    while (i < countB || j < countC) {
        const Uv p = along(b, i, countB), q = along(c, j, countC);
        const bool isB =
            j == countC || (i < countB && squared(along(b, i + 1, countB), q) <= squared(p, along(c, j + 1, countC)));
        if (isB)
            emit(p, along(b, ++i, countB), q);
        else
            emit(p, along(c, j + 1, countC), q), ++j;
    }
}

/// Levels of the edges from corner k to k + 1.
void Cutter::divide(const std::array<Uv, 3>& p, const std::array<int, 3>& levels) {
    for (int k = 0; k < 3; ++k)
        if (levels[(k + 1) % 3] == 0)
            return levels[0] || levels[1] || levels[2]
                       ? zip(p[k], p[(k + 1) % 3], p[(k + 2) % 3], levels[k], levels[(k + 2) % 3])
                       : emit(p[0], p[1], p[2]);
    // All three: four of half the size, whose inner edges are cut as those are that they run along.
    const auto middle = [&](int k) {
        const Uv &a = p[k], &b = p[(k + 1) % 3];
        return Uv{.5f * (a.u + b.u), .5f * (a.v + b.v)};
    };
    const Uv ab = middle(0), bc = middle(1), ca = middle(2);
    const std::array<int, 3> half{levels[0] - 1, levels[1] - 1, levels[2] - 1};
    divide({p[0], ab, ca}, half);
    divide({ab, p[1], bc}, half);
    divide({ca, bc, p[2]}, half);
    divide({bc, ca, ab}, half);
}

void Cutter::cutTriangle(const Touched& touched) {
    std::array<int, 3> levels{};
    for (int k = 0; k < 3; ++k)
        if (touched.edge[k] != kNowhere) levels[k] = table_.edges[touched.edge[k]].level;
    if (!levels[0] && !levels[1] && !levels[2]) return;
    now_ = &touched;
    inside_.clear();
    const auto [a, b, c] = cornersOf(touched.triangle);
    replaced_ += triangleSize(a, b, c).box;
    divide({Uv{0, 0}, Uv{1, 0}, Uv{0, 1}}, levels);
}

std::shared_ptr<const LongTriangles> Cutter::cut() {
    findSame();
    const double minimum = chooseSmallest();
    for (const std::uint32_t triangle : long_) touch(triangle, minimum, true);
    for (std::uint32_t i = 0, k = 0; i < mesh_.triangleCount; ++i) {
        if (k < long_.size() && long_[k] == i)
            ++k;
        else
            touch(i, minimum, false);
    }
    killEdges();
    cutEdges();
    for (const Touched& touched : touched_) cutTriangle(touched);
    if (boxes_ - replaced_ + replacing_ > kCutPays * boxes_) return nullptr;

    auto result = std::make_shared<LongTriangles>();
    result->wholes = mesh_.triangleCount;
    result->positions = Array<Vec3f>::ofSize(positions_.size() + added_.size());
    Vec3f* position = std::copy(positions_.begin(), positions_.end(), result->positions.mutableData());
    for (const Vec3d& p : added_) *position++ = Vec3f(p);
    result->corners = Array<std::int32_t>::ofSize(3 * std::size_t{mesh_.triangleCount} + pieceCorners_.size());
    std::int32_t* corners = result->corners.mutableData();
    for (std::uint32_t i = 0; i < mesh_.triangleCount; ++i)
        for (int k = 0; k < 3; ++k) corners[3 * std::size_t{i} + k] = static_cast<std::int32_t>(corner(i, k));
    for (const LongTriangles::Piece& piece : pieces_) std::fill_n(corners + 3 * std::size_t{piece.triangle}, 3, -1);
    std::ranges::copy(pieceCorners_, corners + 3 * std::size_t{mesh_.triangleCount});
    result->pieces = std::move(pieces_);
    return result;
}

}  // namespace

std::shared_ptr<const LongTriangles> cutLongTriangles(const Mesh& mesh, const Array<Vec3f>& positions) {
    Cutter cutter(mesh, positions);
    return cutter.measure() ? cutter.cut() : nullptr;
}

}  // namespace rtsg::bvh
