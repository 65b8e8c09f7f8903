// Checks whether the text of a script can be parsed; nothing of it runs.
//
// Threading: any thread. Source: ISO/IEC 19775-1 V4.0, 29.2; ECMA-262.
#pragma once

#include <optional>
#include <string>

#include <rtsg/core/script_language.h>

namespace rtsg::script {

/// Nothing if the text can be parsed.
std::optional<SyntaxFault> syntaxFault(const std::string& source);

}  // namespace rtsg::script
