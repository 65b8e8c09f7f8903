// Writes a log under a temporary name and renames it.
#include "whole_log.h"

namespace rtsg {

Result<> writeWholeLog(const std::filesystem::path& out, const LogOptions& options,
                       const std::function<Result<>(LogWriter&)>& write) {
    std::error_code error;
    if (options.existing == Existing::keep && std::filesystem::exists(out, error))
        return fail("there is a file already", {}, out.string());
    if (isBeingWritten(out)) return fail("another log writer has the file open", {}, out.string());
    const std::filesystem::path fresh = freshNameBeside(out);
    Result<> done;
    {
        auto to = LogWriter::create(fresh, builtinTypes(), options);
        done = to ? write(**to) : Result<>(std::unexpected(to.error()));
        if (done) done = (*to)->close();
    }
    if (!done && done.error().file == fresh.string()) {
        Diagnostic why = done.error();
        why.file = out.string();
        done = std::unexpected(std::move(why));
    }
    if (done) {
        const std::filesystem::path target = std::filesystem::exists(out) ? std::filesystem::canonical(out) : out;
        std::filesystem::rename(fresh, target, error);
        if (error) done = fail(error.message(), {}, out.string());
    }
    if (!done) std::filesystem::remove(fresh, error);
    return done;
}

}  // namespace rtsg
