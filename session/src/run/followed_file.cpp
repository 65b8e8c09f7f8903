// Watches the files of a running scene, and carries edits over to the scene.
#include "run/followed_file.h"

#include <map>
#include <utility>

#include <fmt/format.h>

#include <rtsg/session/running_scene.h>

namespace rtsg {

FollowedFile::FollowedFile(Scene& scene, std::string file, const std::optional<Look>& before, Resources resources,
                           std::string clip, SessionContext context)
    : scene_(scene),
      file_(std::move(file)),
      clip_(std::move(clip)),
      resources_(std::move(resources)),
      context_(context),
      document_(scene),
      within_(document_.filesWithin(resources_)),
      followed_(lookAfter(before ? std::vector<Look>{*before} : std::vector<Look>{})),
      last_(followed_) {}

std::optional<FollowedFile::Look> FollowedFile::lookAt(const std::filesystem::path& file) {
    std::error_code error;
    Look one{file, std::filesystem::last_write_time(file, error)};
    if (!error) one.bytes = std::filesystem::file_size(file, error);
    return error ? std::nullopt : std::optional(std::move(one));
}

std::vector<FollowedFile::Look> FollowedFile::look() const {
    std::vector<Look> all;
    const auto add = [&](const std::filesystem::path& file) {
        if (auto one = lookAt(file))
            all.push_back(std::move(*one));  // one that is not there: an editor may be about to put another there
    };
    add(file_);
    for (const auto& file : within_) add(file);
    return all;
}

std::vector<FollowedFile::Look> FollowedFile::lookAfter(const std::vector<Look>& before) const {
    std::map<std::filesystem::path, const Look*> read;
    for (const Look& one : before) read.emplace(one.file, &one);
    std::vector<Look> all = look();
    for (Look& one : all)
        if (const auto found = read.find(one.file); found != read.end()) one = *found->second;
    return all;
}

bool FollowedFile::isEdited() {
    if (isEdited_ || Clock::now() < next_) return isEdited_;
    next_ = Clock::now() + RunningScene::kLookEvery;
    std::vector<Look> now = look();
    isEdited_ = now == last_ && now != followed_ && now.size() == within_.size() + 1;
    last_ = std::move(now);
    return isEdited_;
}

void FollowedFile::follow() {
    isEdited_ = false;
    followed_ = last_;  // one that is wrong is not read again until it has been edited again
    Diagnostics diagnostics(file_);
    LoadOptions options;
    options.resources = resources_;
    options.clip = clip_;
    isBehind_ = !document_.followFile(file_, diagnostics, options);
    context_.report(diagnostics);
    if (isBehind_)
        return context_.report(
            Diagnostic{Severity::error, file_, {}, "it was edited, and is not followed: the scene stays as it was"});
    const auto set = scene_.seal();
    const std::size_t count = set ? set->changes.size() : 0;
    context_.note(fmt::format("{}: note: it was edited: {} change{}", file_, count, count == 1 ? "" : "s"));
    within_ = document_.filesWithin(resources_);
    followed_ = last_ = lookAfter(followed_);
}

}  // namespace rtsg
