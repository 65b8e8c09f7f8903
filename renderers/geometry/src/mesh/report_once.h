// ReportOnce: remembers reports, so that each is made once, however often a changing scene gives reason to.
//
// Invariant: memory is bounded: after kMax different reports, later ones may be repeated.
// Threading: one thread.
#pragma once

#include <functional>
#include <string>
#include <unordered_set>
#include <utility>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

class ReportOnce {
  public:
    static constexpr std::size_t kMax = 4096;

    /// Appends to `into` those of `news` that have not come this way before; of the same words about several nodes
    /// those of the first place.
    void append(const Diagnostics& news, Diagnostics& into) {
        for (const Diagnostic& d : news.all())
            if (const std::size_t hash = std::hash<std::string>{}(d.text); !reported_.contains(hash)) {
                if (reported_.size() < kMax) reported_.insert(hash);
                into.add(d);
            }
    }

    /// `place`: of the node that it is about, if it is known.
    void warning(std::string text, Diagnostics& into, const NodeLocation& location = {}) {
        Diagnostics news;
        news.warningAt(location, std::move(text));
        append(news, into);
    }

  private:
    std::unordered_set<std::size_t> reported_;
};

}  // namespace rtsg
