// The module librtsg_netcdf.so: netCDF-4 files by the netCDF library. It does not link this project's libraries, and
// throws nothing.
#include "sound_io/netcdf_file.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <map>
#include <mutex>

#include <dlfcn.h>

#include <netcdf.h>

namespace rtsg {
namespace {

class LibraryWriter final : public NetcdfWriter {
  public:
    LibraryWriter() { leaveFilesAtExit(); }
    std::string write(const std::string& path, const NetcdfFile& file) const override {
        const std::lock_guard lock(mutex_);  // the library is for one thread at a time
        int id = 0;
        if (const int error = nc_create(path.c_str(), NC_NETCDF4 | NC_CLOBBER, &id)) return nc_strerror(error);
        errno = 0;
        const int error = contents(id, file), closed = nc_close(id);
        return error || closed ? what(error ? error : closed, errno) : "";
    }

  private:
    /// A file that could not be written, on a full disk, HDF5 tries to write once more when the process ends; there it
    /// crashes. netCDF does not hand its library on, so it is asked for by name.
    static void leaveFilesAtExit() {
        Dl_info about = {};
        if (::dladdr(reinterpret_cast<const void*>(&nc_create), &about) == 0 || !about.dli_fname) return;
        void* const library = ::dlopen(about.dli_fname, RTLD_LAZY | RTLD_NOLOAD);
        if (!library) return;
        if (void* const found = ::dlsym(library, "H5dont_atexit")) reinterpret_cast<int (*)()>(found)();
        ::dlclose(library);
    }

    /// The library says "HDF error" for all failures. If writing failed, the system's last error is the reason.
    static std::string what(int error, int system) {
        const bool reports = system == ENOSPC || system == EDQUOT || system == EFBIG || system == EIO;
        return reports ? std::strerror(system) : nc_strerror(error);
    }

    static int note(int id, int variable, const NetcdfAttributes& attributes) {
        for (const auto& [name, value] : attributes)
            if (const int error = nc_put_att_text(id, variable, name.c_str(), value.size(), value.data())) return error;
        return NC_NOERR;
    }

    static int contents(int id, const NetcdfFile& file) {
        std::map<char, std::pair<int, std::size_t>> dimensions;
        for (const auto& [letter, size] : file.dimensions) {
            const char name[] = {letter, 0};
            int dimension = 0;
            if (const int error = nc_def_dim(id, name, size, &dimension)) return error;
            dimensions[letter] = {dimension, size};
        }
        if (const int error = note(id, NC_GLOBAL, file.attributes)) return error;
        std::vector<int> variables;
        for (const NetcdfVariable& variable : file.variables) {
            std::vector<int> along;
            for (const char letter : variable.dimensions) along.push_back(dimensions[letter].first);
            if (const int error = nc_def_var(id, variable.name.c_str(), NC_DOUBLE, static_cast<int>(along.size()),
                                             along.data(), &variables.emplace_back()))
                return error;
            if (const int error = nc_def_var_chunking(id, variables.back(), NC_CONTIGUOUS, nullptr)) return error;
            if (const int error = nc_def_var_fill(id, variables.back(), NC_NOFILL, nullptr)) return error;
            if (const int error = note(id, variables.back(), variable.attributes)) return error;
        }
        if (const int error = nc_enddef(id)) return error;
        for (std::size_t i = 0; i < variables.size(); ++i) {
            std::vector<std::size_t> sizes;
            for (const char letter : file.variables[i].dimensions) sizes.push_back(dimensions[letter].second);
            if (const int error = put(id, variables[i], file.variables[i], sizes)) return error;
        }
        return NC_NOERR;
    }

    static int put(int id, int number, const NetcdfVariable& variable, const std::vector<std::size_t>& sizes) {
        const std::size_t last = sizes.empty() ? 1 : sizes.back();
        std::vector<std::size_t> start(sizes.size(), 0), count(sizes.size(), 1);
        if (!sizes.empty()) count.back() = last;
        // The place of the next row.
        const auto next = [&] {
            for (std::size_t d = sizes.size() - 1; d-- > 0;) {
                if (++start[d] < sizes[d]) return;
                start[d] = 0;
            }
        };
        std::vector<double> padded(variable.rows.empty() ? 0 : last);
        for (const std::span<const float> row : variable.rows) {
            const std::size_t length = std::min(row.size(), last);
            std::copy_n(row.begin(), length, padded.begin());
            std::fill(padded.begin() + static_cast<std::ptrdiff_t>(length), padded.end(), 0.0);
            if (const int error = nc_put_vara_double(id, number, start.data(), count.data(), padded.data()))
                return error;
            next();
        }
        if (!variable.rows.empty()) return NC_NOERR;
        std::size_t all = 1;
        for (const std::size_t size : sizes) all *= size;
        return variable.values.size() == all ? nc_put_var_double(id, number, variable.values.data()) : NC_EEDGE;
    }

    mutable std::mutex mutex_;
};

}  // namespace
}  // namespace rtsg

extern "C" __attribute__((visibility("default"))) const rtsg::NetcdfWriter* RTSG_NETCDF_SYMBOL() {
    static const auto* const writer = new rtsg::LibraryWriter;  // for as long as the process lives
    return writer;
}
