# rtsg_add_replay_test(NAME <test> LOG <file.rlog> ...): a recorded session as a ctest entry, and a target that records it
# anew. Two kinds:
#
#   SCENE <file>      `rtsg replay` runs the scene afresh on the log's input; every frame has to be the recorded one.
#                     Without SCENE and PROGRAM the log is only replayed and verified.
#     FIELDS <NODE.field>...  compare these fields in every frame instead of whole states: HOOK.translation, DOOR.*;
#                     so edits of the scene elsewhere change nothing
#     IGNORE <NODE.field>...  not these; the word initial: nothing that has not changed since the scene was loaded
#     TOLERANCE <n>   the largest difference of any number; of rotations the angle, radians
#     PICTURE <file>  the last state has to look like this; PICTURE_TOLERANCE <rmse>, default 0.01
#     SOUND <file>    the run has to sound like this WAV; SOUND_TOLERANCE <dB>, default -40
#     ARGUMENTS ...   for `rtsg replay`, such as --size 160x120 --viewpoint FRONT
#   PROGRAM <target>  a program of yours that ends in rtsg::replayTestMain: called with the log, and to record with
#                     --update; FIELDS, IGNORE and TOLERANCE go to it
#
# A test of the first kind leaves <build>/replay_tests/<test>.xml (JUnit) and, if it fails, <test>.html: one page with the
# time line, what differed first and by which route, and the pictures side by side.
# `cmake --build . --target <test>.update` records anew, `update_replay_tests` all of them: it goes on where one cannot be,
# and names those in the end.
function(rtsg_add_replay_test)
  cmake_parse_arguments(PARSE_ARGV 0 ARG "" 
                        "NAME;LOG;SCENE;PROGRAM;PICTURE;PICTURE_TOLERANCE;SOUND;SOUND_TOLERANCE;TOLERANCE"
                        "ARGUMENTS;FIELDS;IGNORE")
  if(ARG_UNPARSED_ARGUMENTS OR NOT ARG_NAME OR NOT ARG_LOG)
    message(FATAL_ERROR "rtsg_add_replay_test: NAME and LOG are needed; not understood: ${ARG_UNPARSED_ARGUMENTS}")
  endif()
  if(ARG_PROGRAM AND (ARG_SCENE OR ARG_PICTURE OR ARG_SOUND))
    message(FATAL_ERROR "rtsg_add_replay_test: PROGRAM compares by itself; SCENE, PICTURE and SOUND are for rtsg replay")
  endif()
  if((ARG_FIELDS OR ARG_IGNORE OR DEFINED ARG_TOLERANCE) AND NOT ARG_SCENE AND NOT ARG_PROGRAM)
    message(FATAL_ERROR "rtsg_add_replay_test: FIELDS, IGNORE and TOLERANCE need a SCENE or PROGRAM to compare the log with")
  endif()
  set(compared "")
  foreach(field ${ARG_FIELDS})
    list(APPEND compared --field "${field}")
  endforeach()
  foreach(field ${ARG_IGNORE})
    list(APPEND compared --ignore "${field}")
  endforeach()
  if(DEFINED ARG_TOLERANCE)
    list(APPEND compared --tolerance ${ARG_TOLERANCE})
  endif()
  foreach(path LOG SCENE PICTURE SOUND)
    if(ARG_${path})
      get_filename_component(ARG_${path} "${ARG_${path}}" ABSOLUTE)
    endif()
  endforeach()
  if(ARG_PROGRAM)
    set(command "$<TARGET_FILE:${ARG_PROGRAM}>" "${ARG_LOG}" ${compared} ${ARG_ARGUMENTS})
  else()
    set(command "$<TARGET_FILE:rtsg::rtsg>" replay "${ARG_LOG}" --verify ${compared} ${ARG_ARGUMENTS})
    set(reports "${CMAKE_CURRENT_BINARY_DIR}/replay_tests")
    file(MAKE_DIRECTORY "${reports}")
    list(APPEND command --name "${ARG_NAME}" --junit "${reports}/${ARG_NAME}.xml" --page "${reports}/${ARG_NAME}.html")
    if(ARG_SCENE)
      list(APPEND command --rerun "${ARG_SCENE}")
    endif()
    if(ARG_PICTURE)
      list(APPEND command --expect-picture "${ARG_PICTURE}")
    endif()
    if(ARG_SOUND)
      list(APPEND command --expect-sound "${ARG_SOUND}")
    endif()
    if(DEFINED ARG_PICTURE_TOLERANCE)
      list(APPEND command --picture-tolerance ${ARG_PICTURE_TOLERANCE})
    endif()
    if(DEFINED ARG_SOUND_TOLERANCE)
      list(APPEND command --sound-tolerance=${ARG_SOUND_TOLERANCE})
    endif()
  endif()
  add_test(NAME "${ARG_NAME}" COMMAND ${command} WORKING_DIRECTORY "${CMAKE_CURRENT_BINARY_DIR}")
  set_tests_properties("${ARG_NAME}" PROPERTIES TIMEOUT 300)
  if(ARG_SCENE OR ARG_PROGRAM)
    add_custom_target("${ARG_NAME}.update" COMMAND ${command} --update WORKING_DIRECTORY "${CMAKE_CURRENT_BINARY_DIR}"
                      COMMENT "Recording ${ARG_LOG} anew" VERBATIM)
    # What fails leaves its name, so that the build tool goes on with the others.
    set(failed "${CMAKE_BINARY_DIR}/replay_tests_failed")
    add_custom_target("${ARG_NAME}.update_with_others"
                      COMMAND sh -c "mkdir -p \"$0\"; mark=\"$0/$1\"; rm -f \"$mark\"; shift; \"$@\" || : > \"$mark\"" "${failed}"
                              "${ARG_NAME}" ${command} --update
                      WORKING_DIRECTORY "${CMAKE_CURRENT_BINARY_DIR}" COMMENT "Recording ${ARG_LOG} anew" VERBATIM)
    if(NOT TARGET update_replay_tests)
      add_custom_target(update_replay_tests
                        COMMAND sh -c "names=$(ls \"$0\"); rm -rf \"$0\"; test -z \"$names\" || { echo not recorded anew: $names >&2; exit 1; }"
                                "${failed}"
                        VERBATIM)
    endif()
    add_dependencies(update_replay_tests "${ARG_NAME}.update_with_others")
  endif()
endfunction()
