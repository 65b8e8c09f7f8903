// MaterialTable: acoustic materials by name, from a text file.
//
// The first line names the columns, separated by commas, semicolons or tabs: `name`, octaves of absorption by their
// mid-frequencies in Hz (125, or 1k), and optionally `scattering` (the same in all octaves) or `scattering 125` and so
// on. Octaves without a column take the value of the nearest one; without scattering columns it is .1. Each further
// line is a material; names are unique. Empty lines and text after a # are ignored. Values are shares of energy from 0
// to 1.
// Threading: const once constructed.
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
    /// Errors: the file cannot be read, and the errors of parse().
    static Result<MaterialTable> read(const std::filesystem::path& file);
    /// `file`: for messages. Errors, with line and column: unknown columns, values that are not from 0 to 1, a name
    /// that is used twice, no materials.
    static Result<MaterialTable> parse(std::string_view text, const std::string& file);

    /// Null if there is no material of this name.
    const AcousticMaterial* find(std::string_view name) const;
    struct Row {
        AcousticMaterial material;
        NodeLocation location;
    };
    const std::map<std::string, Row, std::less<>>& rows() const { return rows_; }

  private:
    std::map<std::string, Row, std::less<>> rows_;
};

}  // namespace rtsg
