// Names that authors gave in files of other programs, as DEF names, each of which is given once.
//
// Invariant: no two calls return the same name, unless it is empty. Threading: one thread an import.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <unordered_map>

namespace rtsg::detail {

class UniqueNames {
  public:
    /// `wanted` as UTF-8 without control characters, if it is free; else with the kind behind it, if there is one;
    /// else with a number behind that. The empty name stays empty.
    std::string take(std::string_view wanted, std::string_view kind = {});

  private:
    std::unordered_map<std::string, std::size_t> taken_;  // the number that was given last behind each name
};

}  // namespace rtsg::detail
