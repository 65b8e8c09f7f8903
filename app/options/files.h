// File checks: before any work, checks the files that a verb reads and writes, so that none is overwritten by mistake.
//
// Names of each kind of file have fixed endings, whichever option names them. Inputs and outputs are compared by the
// files that their names lead to, through any links. Pictures, sounds and reports are replaced. Logs and scenes are
// replaced only with --force; so is a log, a scene or a binary file by a report. Existing irregular files (a pipe,
// /dev/null) are not checked, except for the names of pictures and sounds.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <rtsg/core/output_file.h>
#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>
#include <rtsg/session/output_options.h>

#include "command.h"

namespace rtsg::app {

void addForce(Command& command, bool& force);
inline Existing existing(bool force) {
    return force ? Existing::replace : Existing::keep;
}

/// Throws UsageError for a name of which no kind of file is known, or if an output is an input or another output.
/// Error: a file exists and must be kept.
/// another output. Fails where something is there already and is to be kept.
Result<> checkFiles(const std::vector<std::string>& inputs, const std::vector<OutputName>& outputs, bool force);

/// True if the file is a log by its beginning or by its name. So a damaged or empty log counts as one, and so does a
/// folder, which may have the pieces of one.
bool isLogOrNamedSo(const std::string& file);

/// The first file of a log that lies in several (filesOfLog()), or `log` itself.
std::string firstFileOf(const std::string& log);

/// Says on standard error what is missing between the files of a log, or, if it is the last of several pieces, where
/// the earlier states are.
void reportOfPieces(const std::string& log);

/// Throw UsageError if an output is one of the used files, or of those that urls of the scene open. Call the latter
/// when the scene is loaded.
void keepFiles(const std::vector<std::filesystem::path>& used, const std::vector<OutputName>& outputs);
void keepResources(const Scene& scene, const Resources& resources, const std::vector<OutputName>& outputs);

}  // namespace rtsg::app
