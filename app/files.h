// What a verb reads and writes, looked at before any work: nothing that was not meant to go is overwritten.
//
// Inputs and outputs are told apart by the files that their names lead to, through whatever links. Pictures, sounds and
// reports are replaced, reports in the place of a log, a scene or a binary file, as all logs and scenes, only with
// --force. A log takes the place of logs only. What is no regular file (a pipe, /dev/null) is let be.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <rtsg/core/output_file.h>
#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>

#include "command.h"

namespace rtsg::app {

enum class OutputKind { picture, sound, scene, log, report };

struct OutputName {
    std::string option, file;  // "--save"; empty: not asked for
    OutputKind kind = OutputKind::picture;
};

void addForce(Command& command, bool& force);
inline Existing existing(bool force) {
    return force ? Existing::replace : Existing::keep;
}

/// Throws UsageError for a name that says nothing that can be written, and where an output is an input or
/// another output. Fails where something is there already and is to be kept.
Result<> checkFiles(const std::vector<std::string>& inputs, const std::vector<OutputName>& outputs, bool force);

/// A log by how it begins, or by its name: one that is damaged there, or empty, is told as a log.
bool isLogOrNamedSo(const std::string& file);

/// On standard error, if the log is the last of several files: where the session's earlier states are.
void tellOfEarlierPieces(const std::string& log);

/// Throws UsageError where an output is one of the files that are used.
void keepFiles(const std::vector<std::filesystem::path>& used, const std::vector<OutputName>& outputs);
/// The same of those that urls of the scene open; once that is loaded.
void keepResources(const Scene& scene, const Resources& resources, const std::vector<OutputName>& outputs);

}  // namespace rtsg::app
