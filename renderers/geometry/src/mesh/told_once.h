// ToldOnce: remembers reports, so that each is made once, however often a changing scene gives reason to.
//
// Invariant: memory is bounded: after kMost different reports, later ones may be repeated.
// Threading: one thread.
#pragma once

#include <functional>
#include <string>
#include <unordered_set>
#include <utility>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

class ToldOnce {
  public:
    static constexpr std::size_t kMost = 4096;

    /// Appends to `into` those of `news` that have not come this way before; of the same words about several nodes
    /// those of the first place.
    void append(const Diagnostics& news, Diagnostics& into) {
        for (const Diagnostic& d : news.all())
            if (const std::size_t hash = std::hash<std::string>{}(d.text); !told_.contains(hash)) {
                if (told_.size() < kMost) told_.insert(hash);
                into.add(d);
            }
    }

    /// `place`: of the node that it is about, if it is known.
    void warning(std::string text, Diagnostics& into, const NodePlace& place = {}) {
        Diagnostics news;
        news.warningAt(place, std::move(text));
        append(news, into);
    }

  private:
    std::unordered_set<std::size_t> told_;
};

}  // namespace rtsg
