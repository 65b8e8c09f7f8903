// Files that are written beside their name and renamed when they are complete.
#include <rtsg/core/output_file.h>

#include <cerrno>
#include <cstring>
#include <random>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace rtsg {

namespace {

namespace fs = std::filesystem;

/// The file that `file` leads to, whether or not it exists. A circle of links is left as it is: opening it fails.
fs::path followLinks(fs::path file) {
    std::error_code error;
    for (int links = 0; links < 40 && fs::is_symlink(fs::symlink_status(file, error)); ++links) {
        const fs::path to = fs::read_symlink(file, error);
        if (error) break;
        file = to.is_absolute() ? to : file.parent_path() / to;
    }
    return file;
}

}  // namespace

fs::path freshNameBeside(const fs::path& file) {
    const fs::path target = followLinks(file);
    std::random_device random;
    fs::path fresh;
    std::error_code error;
    do {
        // Names have at most 255 bytes in most file systems.
        std::string name = target.filename().string();
        if (name.size() > 200) name.erase(0, name.size() - 200);
        constexpr std::string_view kDigits = "0123456789abcdefghijklmnopqrstuv";
        std::string token;
        for (std::uint32_t bits = random(), i = 0; i < 6; ++i, bits >>= 5) token += kDigits[bits & 31];
        fresh = target.parent_path() / (".rtsg-" + token + "-" + name);
    } while (fs::exists(fs::symlink_status(fresh, error)));
    return fresh;
}

Result<OutputFile> OutputFile::create(const fs::path& file, Existing existing) {
    OutputFile out;
    out.file_ = file;
    out.target_ = followLinks(file);
    out.existing_ = existing;
    struct stat status{};
    const bool there = ::stat(file.c_str(), &status) == 0;
    if (there && !S_ISREG(status.st_mode)) {
        out.descriptor_ = ::open(file.c_str(), O_WRONLY | O_CLOEXEC);
        if (out.descriptor_ < 0) return std::unexpected(out.failure(errno).error());
        return out;
    }
    if (there && existing == Existing::keep) return std::unexpected(out.failure(EEXIST).error());
    // One that may not be written may not be replaced either, though the folder would allow it.
    if (there && ::access(file.c_str(), W_OK) != 0) return std::unexpected(out.failure(errno).error());
    const fs::path fresh = freshNameBeside(file);
    out.descriptor_ = ::open(fresh.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (out.descriptor_ < 0) return std::unexpected(out.failure(errno).error());
    out.fresh_ = fresh;
    if (there && ::fchmod(out.descriptor_, status.st_mode & 0777) != 0)
        return std::unexpected(out.failure(errno).error());
    return out;
}

OutputFile::OutputFile(OutputFile&& other) noexcept {
    *this = std::move(other);
}

OutputFile& OutputFile::operator=(OutputFile&& other) noexcept {
    if (this == &other) return *this;
    discard();
    file_ = std::move(other.file_);
    target_ = std::move(other.target_);
    fresh_ = std::exchange(other.fresh_, {});
    descriptor_ = std::exchange(other.descriptor_, -1);
    error_ = other.error_;
    existing_ = other.existing_;
    return *this;
}

OutputFile::~OutputFile() {
    discard();
}

void OutputFile::discard() {
    if (descriptor_ >= 0) ::close(descriptor_);
    descriptor_ = -1;
    if (!fresh_.empty()) ::unlink(fresh_.c_str());
    fresh_.clear();
}

Result<> OutputFile::failure(int error) {
    if (error_ == 0) error_ = error;
    return fail(error_ == EEXIST ? "there is a file already" : std::string("cannot write: ") + std::strerror(error_),
                {}, file_.string());
}

Result<> OutputFile::write(std::span<const std::byte> bytes) {
    if (error_ != 0 || descriptor_ < 0) return failure(EBADF);
    while (!bytes.empty()) {
        const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
        if (written < 0 && errno == EINTR) continue;
        if (written <= 0) return failure(written < 0 ? errno : ENOSPC);
        bytes = bytes.subspan(static_cast<std::size_t>(written));
    }
    return {};
}

Result<> OutputFile::commit() {
    if (error_ != 0 || descriptor_ < 0) return failure(EBADF);
    // Some file systems find out here that there is no room.
    if (!fresh_.empty() && ::fdatasync(descriptor_) != 0 && errno != EINVAL && errno != EROFS) return failure(errno);
    if (::close(std::exchange(descriptor_, -1)) != 0) return failure(errno);
    if (fresh_.empty()) return {};
    std::error_code error;
    if (existing_ == Existing::keep && fs::exists(fs::symlink_status(target_, error))) return failure(EEXIST);
    if (::rename(fresh_.c_str(), target_.c_str()) != 0) return failure(errno);
    fresh_.clear();
    return {};
}

Result<> writeWholeFile(const fs::path& file, std::span<const std::byte> bytes, Existing existing) {
    auto out = OutputFile::create(file, existing);
    if (!out) return std::unexpected(out.error());
    if (auto ok = out->write(bytes); !ok) return ok;
    return out->commit();
}

bool sameFile(const fs::path& a, const fs::path& b) {
    struct stat first{}, second{};
    const bool one = ::stat(a.c_str(), &first) == 0, other = ::stat(b.c_str(), &second) == 0;
    if (one || other) return one && other && first.st_dev == second.st_dev && first.st_ino == second.st_ino;
    // weakly_canonical() leaves a relative name of a missing file unchanged, so the name is made absolute first.
    const auto folderOf = [](const fs::path& file) {
        std::error_code error;
        const fs::path whole = fs::weakly_canonical(fs::absolute(followLinks(file), error), error);
        return error ? fs::path() : whole;
    };
    const fs::path x = folderOf(a);
    return !x.empty() && x == folderOf(b);
}

}  // namespace rtsg
