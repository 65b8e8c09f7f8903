// Writes a log that is there as a whole or not at all.
#pragma once

#include <filesystem>
#include <functional>

#include <rtsg/sync/log.h>

namespace rtsg {

/// Until `write` has returned and the log is closed, the file has a temporary name that users do not know. Errors:
/// those of `write`; the file exists and must be kept, another writer has it open, it cannot be written.
Result<> writeWholeLog(const std::filesystem::path& out, const LogOptions& options,
                       const std::function<Result<>(LogWriter&)>& write);

}  // namespace rtsg
