// Sources whose scene runs elsewhere.
//
// Threading: the scene's thread.
#pragma once

#include <rtsg/session/view_source.h>

namespace rtsg {

Result<std::unique_ptr<ViewSource>> openServed(const ViewSourceOptions& options);
Result<std::unique_ptr<ViewSource>> openLog(const ViewSourceOptions& options);

}  // namespace rtsg
