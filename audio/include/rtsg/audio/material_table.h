// MaterialTable: acoustic materials by name, from a text file.
//
// The first line names the columns, separated by commas, semicolons or tabs: `name`, octaves of absorption by their
// mid-frequencies in Hz (125, or 1k), and maybe `scattering` (all octaves alike) or `scattering 125` and so on. Octaves
// that are not there have the value of the nearest that is; without scattering it is .1. Each further line is a
// material; names are unique. Empty lines, and what follows a #, do not count. Values are shares of energy from 0 to 1.
// Threading: const once made.
//
//     name,     125, 250, 500, 1k,  2k,  4k,  scattering
//     curtain,  .07, .31, .49, .75, .70, .60, .3
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/core/diagnostic.h>

namespace rtsg {

class MaterialTable {
  public:
    /// Errors: a file that cannot be read, and what parse() finds.
    static Result<MaterialTable> read(const std::filesystem::path& file);
    /// `file`: for messages. Errors, with line and column: columns that are none, values that are no shares, names
    /// twice, no material at all.
    static Result<MaterialTable> parse(std::string_view text, const std::string& file);

    /// Null where there is none of this name.
    const AcousticMaterial* find(std::string_view name) const;
    struct Row {
        AcousticMaterial material;
        NodePlace place;
    };
    const std::map<std::string, Row, std::less<>>& rows() const { return rows_; }

  private:
    std::map<std::string, Row, std::less<>> rows_;
};

}  // namespace rtsg
