// FollowedFile: notices that a scene's file, or an inlined file, has been edited, and makes the scene follow the edit.
//
// An edit counts once two looks in a row find the same content, so that a half-written file is seldom read. If the
// edited file has errors, the scene stays as it was, and the notices say why and where.
// Threading: the scene's thread, between frames.
#pragma once

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/documents/edited_document.h>
#include <rtsg/session/notices.h>

namespace rtsg {

class FollowedFile {
  public:
    struct Look {
        std::filesystem::path file;
        std::filesystem::file_time_type written;
        std::uintmax_t bytes = 0;
        friend bool operator==(const Look&, const Look&) = default;
    };
    /// Nothing if there is no such file.
    static std::optional<Look> lookAt(const std::filesystem::path& file);

    /// Call it when the file has been loaded into the scene, before the first frame. `before`: the file's look before
    /// it was read. `clip`: as LoadOptions has it.
    FollowedFile(Scene& scene, std::string file, const std::optional<Look>& before, Resources resources,
                 std::string clip, SessionContext context);

    /// Looks at the files if it is time to. True until follow() is called.
    bool isEdited();
    /// The scene follows the file, and seals what that changes.
    void follow();
    /// The file as it is now could not be followed.
    bool isBehind() const { return isBehind_; }

  private:
    std::vector<Look> look() const;
    /// Files that were looked at before they were read keep that look: those edited meanwhile count as edited.
    std::vector<Look> lookAfter(const std::vector<Look>& before) const;

    using Clock = std::chrono::steady_clock;
    Scene& scene_;
    const std::string file_, clip_;
    const Resources resources_;
    const SessionContext context_;
    EditedDocument document_;
    std::vector<std::filesystem::path> within_;
    std::vector<Look> followed_, last_;
    Clock::time_point next_ = Clock::now();
    bool isEdited_ = false, isBehind_ = false;
};

}  // namespace rtsg
