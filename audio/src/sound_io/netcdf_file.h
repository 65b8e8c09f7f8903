// netCDF-4 files, by a module (librtsg_netcdf.so) that is loaded when the first one is written: its libraries are
// large, and few programs need them.
//
// Invariant: nothing of netCDF or HDF5 is on this side; the module links nothing of ours. Variables are laid out
// without gaps and unpacked, so that readers of a part of HDF5 can read them, too. Threading: any thread; files are
// written one after the other.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

using NetcdfAttributes = std::vector<std::pair<std::string, std::string>>;

/// Doubles by default, the last dimension running fastest.
struct NetcdfVariable {
    std::string name;
    std::string dimensions;  // one letter each, in order
    std::vector<double> values;
    /// In place of values, rows along the last dimension, in order; they may be shorter than it: the rest is 0.
    std::vector<std::span<const float>> rows = {};
    NetcdfAttributes attributes = {};
};

struct NetcdfFile {
    std::vector<std::pair<char, std::size_t>> dimensions;
    NetcdfAttributes attributes;
    std::vector<NetcdfVariable> variables;
};

class NetcdfWriter {
  public:
    virtual ~NetcdfWriter() = default;
    /// Returns the error, or nothing. An existing file is replaced; after an error it may be incomplete.
    virtual std::string write(const std::string& path, const NetcdfFile& file) const = 0;
};

/// Error: the module is not there, or was left out of this build.
Result<const NetcdfWriter*> netcdfWriter();

}  // namespace rtsg

/// The symbol of the module; it changes when the interface above does.
#define RTSG_NETCDF_SYMBOL rtsgNetcdfWriter1
extern "C" const rtsg::NetcdfWriter* RTSG_NETCDF_SYMBOL();
