// Checks the files that a verb reads and writes before any work, so that nothing is overwritten that was not meant to
// be.
//
// Each kind of file has names that end as it says, whichever option names it. Inputs and outputs are told apart by the
// files that their names lead to, through any links. Pictures, sounds and reports are replaced. Logs and scenes are
// replaced only with --force; so is a log, a scene or a binary file by a report. Names of what is there and no regular
// file (a pipe, /dev/null) are not checked, but for those of pictures and sounds.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <rtsg/core/output_file.h>
#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>

#include "command.h"

namespace rtsg::app {

/// `map`: a picture or a table of a RoomMap; `capture`: an MCAP file; `page`: one that shows a test; `testResult`:
/// JUnit's XML.
enum class OutputKind : std::uint8_t { picture, sound, response, scene, log, capture, report, map, page, testResult };

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

/// Whether the file is a log by its beginning or by its name, so that one whose beginning is damaged, or that is empty,
/// counts as a log.
bool isLogOrNamedSo(const std::string& file);

/// On standard error, if the log is the last of several files: where the session's earlier states are.
void tellOfEarlierPieces(const std::string& log);

/// Throws UsageError where an output is one of the files that are used.
void keepFiles(const std::vector<std::filesystem::path>& used, const std::vector<OutputName>& outputs);
/// The same for files that urls of the scene open; to be called once it is loaded.
void keepResources(const Scene& scene, const Resources& resources, const std::vector<OutputName>& outputs);

}  // namespace rtsg::app
