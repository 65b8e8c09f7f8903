// DiskCache: a folder of files that were fetched, with what their servers said of them, shared by processes.
//
// `entries/` has a text for each address, `files/` the contents, by their SHA-256. Invariant: a file is complete before
// it has its name, and is believed only if its bytes have its hash, so that processes need no locks, and a file that
// another one deletes or damages is just not there. Once files take more than the limit, the ones longest unused go.
// Threading: any thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "transfer_module.h"

namespace rtsg::fetch {

struct CacheEntry {
    std::string mediaType, etag, lastModified, hash;
};

class DiskCache {
  public:
    /// An empty folder, or one that cannot be made: nothing is kept.
    DiskCache(std::filesystem::path folder, std::uint64_t limit);

    std::optional<CacheEntry> find(const std::string& address, const TransferModule& module) const;
    /// Its bytes, if they are there, at most `maximumBytes`, and have that hash.
    std::optional<std::string> content(const std::string& hash, std::uint64_t maximumBytes,
                                       const TransferModule& module) const;
    void store(const std::string& address, const CacheEntry& entry, std::string_view bytes,
               const TransferModule& module) const;

  private:
    void write(const std::filesystem::path& file, std::string_view bytes) const;
    void shrink() const;

    std::filesystem::path folder_;
    std::uint64_t limit_;
};

}  // namespace rtsg::fetch
