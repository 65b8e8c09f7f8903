// The content of a folder, as somebody sees it who looks for a scene to open.
//
// Threading: one thread.
#pragma once

#include <filesystem>
#include <string>

#include "overlay_content.h"

namespace rtsg {

class FileList {
  public:
    /// An empty folder is the working folder.
    void setFolder(const std::filesystem::path& folder);
    /// Goes into a folder of the list, or out of this one by "..".
    void enter(const std::string& name);
    /// The path of a file of the list.
    std::string path(const std::string& name) const { return (folder_ / name).string(); }
    /// Folders first; of files those that may be scenes or logs. It is read anew at each call.
    OverlayContent::Files read() const;

  private:
    std::filesystem::path folder_;
};

}  // namespace rtsg
