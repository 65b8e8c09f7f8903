// Simple polygons in n log n: cut into monotone pieces by a sweep (de Berg et al., Computational Geometry, 3.2),
// then each piece by a stack (3.3). The areas of the triangles prove the result: they are positive and add up to the
// polygon's, or the input was not simple.
#include <algorithm>
#include <set>

#include "tessellate_detail.h"

namespace rtsg::detail {

namespace {

using Index = std::uint32_t;

double cross(Vec2d a, Vec2d b) {
    return a.x * b.y - a.y * b.x;
}

class MonotoneCutter {
  public:
    MonotoneCutter(std::span<const Vec2d> points, std::vector<std::array<int, 3>>& out)
        : p_(points), n_(static_cast<Index>(points.size())), out_(out), status_(LeftOf{this}), rank_(n_), helper_(n_) {}

    bool run() {
        sweep();
        if (!consistent_) return false;
        cutPieces();
        return consistent_ && proven();
    }

  private:
    enum class Kind : std::uint8_t { start, end, split, merge, left, right };

    Index next(Index i) const { return i + 1 == n_ ? 0 : i + 1; }
    Index previous(Index i) const { return i == 0 ? n_ - 1 : i - 1; }
    /// Higher points come first, of equally high ones the left one; the number makes the order total.
    bool before(Index a, Index b) const {
        if (p_[a].y != p_[b].y) return p_[a].y > p_[b].y;
        if (p_[a].x != p_[b].x) return p_[a].x < p_[b].x;
        return a < b;
    }
    double orientation(Index a, Index b, Index c) const { return cross(p_[b] - p_[a], p_[c] - p_[a]); }

    // Edge i runs from corner i to the next; in the status are those that run downwards, with the inside to the right.
    struct LeftOf {
        using is_transparent = void;
        struct Point {
            Index corner;
        };
        const MonotoneCutter* cutter;
        bool operator()(Index a, Index b) const {
            if (a == b) return false;
            const MonotoneCutter& c = *cutter;
            if (c.before(a, b)) return c.orientation(a, c.next(a), b) > 0;
            return c.orientation(b, c.next(b), a) < 0;
        }
        bool operator()(Index edge, Point p) const {
            return cutter->orientation(edge, cutter->next(edge), p.corner) > 0;
        }
        bool operator()(Point p, Index edge) const {
            return cutter->orientation(edge, cutter->next(edge), p.corner) < 0;
        }
    };
    using Status = std::set<Index, LeftOf>;

    Kind kindOf(Index i) const {
        const bool fromAbove = before(previous(i), i), toBelow = before(i, next(i));
        if (fromAbove && toBelow) return Kind::left;
        if (!fromAbove && !toBelow) return Kind::right;
        const bool convex = orientation(previous(i), i, next(i)) > 0;
        if (toBelow) return convex ? Kind::start : Kind::split;
        return convex ? Kind::end : Kind::merge;
    }

    void insert(Index edge) {
        const auto [position, isNew] = status_.insert(edge);
        if (!isNew) {
            consistent_ = false;
            return;
        }
        rank_[edge] = position;
        inStatus_[edge] = true;
        helper_[edge] = edge;
    }
    /// Takes out the edge that ends at corner i.
    void closeEdgeInto(Index i) {
        const Index edge = previous(i);
        if (!inStatus_[edge]) {
            consistent_ = false;
            return;
        }
        joinMerge(i, edge);
        status_.erase(rank_[edge]);
        inStatus_[edge] = false;
    }
    void joinMerge(Index i, Index edge) {
        if (kinds_[helper_[edge]] == Kind::merge) diagonals_.emplace_back(i, helper_[edge]);
    }
    bool edgeLeftOf(Index i, Index& edge) {
        auto position = status_.lower_bound(LeftOf::Point{i});
        if (position == status_.begin()) {
            consistent_ = false;
            return false;
        }
        edge = *--position;
        return true;
    }

    void sweep() {
        std::vector<Index> order(n_);
        for (Index i = 0; i < n_; ++i) {
            order[i] = i;
            kinds_.push_back(kindOf(i));
        }
        inStatus_.assign(n_, false);
        std::sort(order.begin(), order.end(), [&](Index a, Index b) { return before(a, b); });
        for (const Index i : order) {
            Index edge = 0;
            switch (kinds_[i]) {
                case Kind::start:
                    insert(i);
                    break;
                case Kind::end:
                    closeEdgeInto(i);
                    break;
                case Kind::split:
                    if (!edgeLeftOf(i, edge)) return;
                    diagonals_.emplace_back(i, helper_[edge]);
                    helper_[edge] = i;
                    insert(i);
                    break;
                case Kind::merge:
                    closeEdgeInto(i);
                    [[fallthrough]];
                case Kind::right:
                    if (!consistent_ || !edgeLeftOf(i, edge)) return;
                    joinMerge(i, edge);
                    helper_[edge] = i;
                    break;
                case Kind::left:
                    closeEdgeInto(i);
                    insert(i);
                    break;
            }
            if (!consistent_) return;
        }
    }

    /// Walks each face of the polygon with its diagonals: at every corner the next way out, clockwise.
    void cutPieces() {
        struct Branch {
            Index from, to;
            bool used = false;
        };
        std::vector<Branch> branches;
        branches.reserve(n_ + 2 * diagonals_.size());
        for (Index i = 0; i < n_; ++i) branches.push_back({i, next(i)});
        for (const auto& [a, b] : diagonals_) {
            branches.push_back({a, b});
            branches.push_back({b, a});
        }
        const auto upper = [](Vec2d d) { return d.y > 0 || (d.y == 0 && d.x > 0); };
        std::sort(branches.begin(), branches.end(), [&](const Branch& a, const Branch& b) {
            if (a.from != b.from) return a.from < b.from;
            const Vec2d da = p_[a.to] - p_[a.from], db = p_[b.to] - p_[b.from];
            if (upper(da) != upper(db)) return upper(da);
            const double angle = cross(da, db);
            return angle != 0 ? angle > 0 : a.to < b.to;
        });
        std::vector<std::size_t> first(n_ + 1, branches.size());
        for (std::size_t w = branches.size(); w-- > 0;) first[branches[w].from] = w;

        std::vector<Index> piece;
        for (std::size_t start = 0; start < branches.size(); ++start) {
            if (branches[start].used) continue;
            piece.clear();
            for (std::size_t w = start; !branches[w].used;) {
                branches[w].used = true;
                piece.push_back(branches[w].from);
                w = exitDistance(branches, first, branches[w].from, branches[w].to);
            }
            cutMonotone(piece);
            if (!consistent_) return;
        }
    }
    template <class Branches>
    std::size_t exitDistance(const Branches& branches, const std::vector<std::size_t>& first, Index from,
                             Index at) const {
        const std::size_t begin = first[at], end = first[at + 1];
        // Few ways leave most corners; where many do, they are sorted counter-clockwise.
        if (end - begin == 1) return begin;
        const Vec2d back = p_[from] - p_[at];
        const auto upper = [](Vec2d d) { return d.y > 0 || (d.y == 0 && d.x > 0); };
        const auto position =
            std::partition_point(branches.begin() + static_cast<std::ptrdiff_t>(begin),
                                 branches.begin() + static_cast<std::ptrdiff_t>(end), [&](const auto& branch) {
                                     const Vec2d d = p_[branch.to] - p_[at];
                                     if (upper(d) != upper(back)) return upper(d);
                                     return cross(d, back) > 0;
                                 });
        const auto found = static_cast<std::size_t>(position - branches.begin());
        return found == begin ? end - 1 : found - 1;
    }

    void add(Index a, Index b, Index c) {
        if (orientation(a, b, c) < 0) std::swap(b, c);
        out_.push_back({static_cast<int>(a), static_cast<int>(b), static_cast<int>(c)});
    }

    void cutMonotone(const std::vector<Index>& piece) {
        const std::size_t size = piece.size();
        if (size < 3) {
            consistent_ = false;
            return;
        }
        if (size == 3) return add(piece[0], piece[1], piece[2]);
        std::size_t top = 0;
        for (std::size_t i = 1; i < size; ++i)
            if (before(piece[i], piece[top])) top = i;
        // Counter-clockwise from the top goes down the left chain; backwards, the right one.
        sorted_.assign(1, {piece[top], true});
        for (std::size_t l = 1, r = 1; l + r <= size;) {
            const Index a = piece[(top + l) % size], b = piece[(top + size - r) % size];
            if (before(a, b) || l + r == size) {
                sorted_.emplace_back(a, true);
                ++l;
            } else {
                sorted_.emplace_back(b, false);
                ++r;
            }
        }
        stack_.assign(sorted_.begin(), sorted_.begin() + 2);
        for (std::size_t i = 2; i < size; ++i) {
            const auto [corner, isLeft] = sorted_[i];
            const auto top2 = stack_.back();
            if (i + 1 == size || top2.second != isLeft) {
                for (std::size_t k = 0; k + 1 < stack_.size(); ++k) add(corner, stack_[k].first, stack_[k + 1].first);
                stack_ = {top2, sorted_[i]};
                continue;
            }
            stack_.pop_back();
            auto last = top2;
            while (!stack_.empty()) {
                const double angle = orientation(corner, last.first, stack_.back().first);
                if (!(isLeft ? angle < 0 : angle > 0)) break;
                add(corner, last.first, stack_.back().first);
                last = stack_.back();
                stack_.pop_back();
            }
            stack_.push_back(last);
            stack_.push_back(sorted_[i]);
        }
    }

    bool proven() const {
        if (out_.size() != n_ - 2) return false;
        double wanted = 0, reached = 0;
        for (Index i = 1; i + 1 < n_; ++i) wanted += orientation(0, i, i + 1);
        for (const auto& t : out_)
            reached += orientation(static_cast<Index>(t[0]), static_cast<Index>(t[1]), static_cast<Index>(t[2]));
        // add() makes every area positive, so an overlap shows as an excess.
        return std::abs(reached - wanted) <= 1e-9 * (1 + std::abs(wanted));
    }

    std::span<const Vec2d> p_;
    Index n_;
    std::vector<std::array<int, 3>>& out_;
    bool consistent_ = true;
    Status status_;
    std::vector<Status::iterator> rank_;
    std::vector<Index> helper_;
    std::vector<bool> inStatus_;
    std::vector<Kind> kinds_;
    std::vector<std::pair<Index, Index>> diagonals_;
    std::vector<std::pair<Index, bool>> sorted_, stack_;
};

}  // namespace

bool cutSimplePolygon(std::span<const Vec2d> points, std::vector<std::array<int, 3>>& triangles) {
    triangles.clear();
    if (points.size() >= 3 && MonotoneCutter(points, triangles).run()) return true;
    triangles.clear();
    return false;
}

}  // namespace rtsg::detail
