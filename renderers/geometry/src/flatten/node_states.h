// NodeStates: the flattener's data for each node, by node number.
//
// Numbers are never reused. Those of a file are dense and lie in an array. Those of sets from elsewhere may have gaps,
// and those of a long session grow without end; numbers far above the count of nodes are kept in a tree. Invariant:
// memory depends on the count of nodes, not on their numbers. Threading: one thread.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

namespace rtsg::flatten {

/// `State::isIdle()`: it may be forgotten.
template <class State>
class NodeStates {
  public:
    /// The state of a node in the array; null for other nodes.
    State* dense(std::uint32_t id) { return id < dense_.size() ? &dense_[id] : nullptr; }
    /// Made when it is not there. `nodes`: how many there are in the scene. Valid until the next call.
    State& at(std::uint32_t id, std::size_t nodes) {
        if (State* state = dense(id)) return *state;
        const std::size_t maximum = kDense * nodes + kAlways;
        if (id < maximum) {
            makeDense(std::min(maximum, std::max<std::size_t>(id + std::size_t{1}, dense_.size() * 3 / 2)));
            return dense_[id];
        }
        return scattered_[id];
    }
    /// Null: there is none.
    const State* find(std::uint32_t id) const {
        if (id < dense_.size()) return &dense_[id];
        const auto found = scattered_.find(id);
        return found == scattered_.end() ? nullptr : &found->second;
    }
    /// Forgets unused entries; done now and then, so that it costs nothing.
    void tidy() {
        if (scattered_.size() < 2 * kept_ + kAlways) return;
        std::erase_if(scattered_, [](const auto& entry) { return entry.second.isIdle(); });
        kept_ = scattered_.size();
    }
    std::size_t bytes() const {
        return dense_.capacity() * sizeof(State) + scattered_.size() * (sizeof(State) + kTreeNode);
    }

  private:
    static constexpr std::size_t kDense = 4, kAlways = 4096, kTreeNode = 48;

    void makeDense(std::size_t size) {
        dense_.resize(size);
        while (!scattered_.empty() && scattered_.begin()->first < size) {
            dense_[scattered_.begin()->first] = scattered_.begin()->second;
            scattered_.erase(scattered_.begin());
        }
    }

    std::vector<State> dense_;
    std::map<std::uint32_t, State> scattered_;  // not a hash table: whoever sends numbers could have them collide
    std::size_t kept_ = 0;
};

}  // namespace rtsg::flatten
