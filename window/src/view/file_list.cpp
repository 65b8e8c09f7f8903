// Lists folders, and the files whose names end as those of scenes and logs do.
#include "file_list.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>
#include <system_error>

namespace rtsg {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxEntries = 2000;
constexpr std::array<std::string_view, 17> kEndings{".x3d",   ".x3dv", ".x3dj", ".json",  ".wrl",  ".x3dz",
                                                    ".x3dvz", ".wrz",  ".gz",   ".rtsgb", ".rlog", ".gltf",
                                                    ".glb",   ".obj",  ".stl",  ".ply",   ".urdf"};

bool mayBeShown(const fs::path& file) {
    std::string ending = file.extension().string();
    std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return std::ranges::find(kEndings, ending) != kEndings.end();
}

}  // namespace

void FileList::setFolder(const fs::path& folder) {
    std::error_code error;
    folder_ = fs::absolute(folder.empty() ? fs::path(".") : folder, error).lexically_normal();
    if (folder_.has_relative_path() && !folder_.has_filename()) folder_ = folder_.parent_path();
}

void FileList::enter(const std::string& name) {
    setFolder(name == ".." ? folder_.parent_path() : folder_ / name);
}

OverlayContent::Files FileList::read() const {
    OverlayContent::Files files;
    files.folder = folder_.string();
    if (folder_.has_relative_path()) files.entries.push_back({"..", true});
    const auto first = static_cast<std::ptrdiff_t>(files.entries.size());
    std::error_code error;
    for (fs::directory_iterator at(folder_, fs::directory_options::skip_permission_denied, error), end;
         !error && at != end && files.entries.size() < kMaxEntries; at.increment(error)) {
        const std::string name = at->path().filename().string();
        std::error_code unknown;
        const bool isFolder = at->is_directory(unknown);
        if (!name.starts_with('.') && (isFolder || mayBeShown(at->path()))) files.entries.push_back({name, isFolder});
    }
    std::sort(files.entries.begin() + first, files.entries.end(),
              [](const auto& a, const auto& b) { return a.isFolder != b.isFolder ? a.isFolder : a.name < b.name; });
    return files;
}

}  // namespace rtsg
