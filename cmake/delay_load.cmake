# Writes what rtsg_delay_load makes of FILES, shared libraries: STUBS has a stub for each of their functions, TABLE is the module that holds
# the functions' addresses, and LIBRARY defines the object that loads it. The table's name says for which functions it was made.
cmake_minimum_required(VERSION 3.25)

set(functions)
foreach(file IN LISTS FILES)
  execute_process(COMMAND "${NM}" -D --defined-only -S "${file}" OUTPUT_VARIABLE listed COMMAND_ERROR_IS_FATAL ANY)
  string(REPLACE "\n" ";" listed "${listed}")
  foreach(line IN LISTS listed)
    # A symbol may have a version behind @@; older versions, behind one @, are not what a linker takes.
    if(NOT line MATCHES "^[0-9a-f]+ ([0-9a-f]+ )?([TiDBR]) ([^@ ]+)(@@[^ ]*)?$")
      continue()
    endif()
    set(size "${CMAKE_MATCH_1}")
    set(kind "${CMAKE_MATCH_2}")
    set(symbol "${CMAKE_MATCH_3}")
    if(kind MATCHES "[Ti]" AND symbol MATCHES "${SYMBOLS}")
      list(APPEND functions "${symbol}")
    elseif(symbol IN_LIST DATA)
      math(EXPR size_of_${symbol} "0x${size}")
    endif()
  endforeach()
endforeach()
list(REMOVE_DUPLICATES functions)


set(opening "// Made by cmake/delay_load.cmake.\n#include <rtsg/core/module.h>\n\n")
set(namespace "namespace rtsg::delayed {\n[[gnu::visibility(\"hidden\")]] extern DelayedLibrary ${NAME};\nconstinit DelayedLibrary ${NAME}")
if(MACHINE STREQUAL "none")
  file(WRITE "${LIBRARY}" "${opening}${namespace}{{}};\n}  // namespace rtsg::delayed\n")
  return()
endif()

string(MD5 hash "${MACHINE} ${functions} ${DATA}")
string(SUBSTRING "${hash}" 0 12 hash)
set(table "rtsg_table_${NAME}_${hash}")
set(slots "rtsg_slots_${NAME}")
string(LENGTH "${NAME}" length)
set(library "_ZN4rtsg7delayed${length}${NAME}E")

set(stubs "")
set(firsts "")
set(entries "")
set(addresses "")
set(count 0)
foreach(symbol IN LISTS functions)
  math(EXPR offset "8 * ${count}")
  string(APPEND stubs ".globl ${symbol}\n.hidden ${symbol}\n.type ${symbol}, %function\n${symbol}:\n.cfi_startproc\n")
  if(MACHINE STREQUAL "aarch64")
    string(APPEND stubs "  hint 34\n  adrp x16, ${slots}+${offset}\n  ldr x16, [x16, :lo12:${slots}+${offset}]\n  br x16\n")
    string(APPEND firsts ".Lfirst${count}:\n.cfi_startproc\n  hint 34\n  mov w17, ${count}\n  b .Lload\n.cfi_endproc\n")
  else()
    string(APPEND stubs "  endbr64\n  jmp *${slots}+${offset}(%rip)\n")
    string(APPEND firsts ".Lfirst${count}:\n.cfi_startproc\n  endbr64\n  push $${count}\n.cfi_adjust_cfa_offset 8\n  jmp .Lload\n.cfi_endproc\n")
  endif()
  string(APPEND stubs ".cfi_endproc\n.size ${symbol}, .-${symbol}\n")
  string(APPEND entries ".quad .Lfirst${count}\n")
  string(APPEND addresses ".quad ${symbol}\n")
  math(EXPR count "${count} + 1")
endforeach()

# Copies of values.
set(copies "")
set(declared "")
set(rows "")
set(copied 0)
foreach(symbol IN LISTS DATA)
  if(NOT DEFINED size_of_${symbol})
    continue()  # another version of the library
  endif()
  set(size "${size_of_${symbol}}")
  string(APPEND copies ".globl ${symbol}\n.hidden ${symbol}\n.type ${symbol}, %object\n.size ${symbol}, ${size}\n.balign 16\n${symbol}: .skip ${size}\n")
  string(APPEND declared "extern \"C\" [[gnu::visibility(\"hidden\")]] char rtsg_copy_${NAME}_${copied} __asm__(\"${symbol}\");\n")
  string(APPEND rows "    {&rtsg_copy_${NAME}_${copied}, ${size}},\n")
  string(APPEND addresses ".quad ${symbol}\n")
  math(EXPR copied "${copied} + 1")
endforeach()

# The first call keeps everything in which arguments may be while the library is loaded. Each stub and each first call begins as targets of indirect
# jumps do (endbr64, `bti c`), and notes say so to the linker. Unwinders find their callers, as an exception says that the library is missing.
if(MACHINE STREQUAL "aarch64")
  set(load "
.cfi_startproc
  stp x29, x30, [sp, -224]!
.cfi_def_cfa_offset 224
.cfi_offset x29, -224
.cfi_offset x30, -216
  mov x29, sp
  stp x0, x1, [sp, 16]
  stp x2, x3, [sp, 32]
  stp x4, x5, [sp, 48]
  stp x6, x7, [sp, 64]
  str x8, [sp, 80]
  stp q0, q1, [sp, 96]
  stp q2, q3, [sp, 128]
  stp q4, q5, [sp, 160]
  stp q6, q7, [sp, 192]
  adrp x0, ${library}
  add x0, x0, :lo12:${library}
  mov w1, w17
  bl rtsg_first_call
  mov x16, x0
  ldp q0, q1, [sp, 96]
  ldp q2, q3, [sp, 128]
  ldp q4, q5, [sp, 160]
  ldp q6, q7, [sp, 192]
  ldp x0, x1, [sp, 16]
  ldp x2, x3, [sp, 32]
  ldp x4, x5, [sp, 48]
  ldp x6, x7, [sp, 64]
  ldr x8, [sp, 80]
  ldp x29, x30, [sp], 224
.cfi_def_cfa_offset 0
.cfi_restore x29
.cfi_restore x30
  br x16
.cfi_endproc
")
  set(property "0xc0000000, 4, 1, 0")  # GNU_PROPERTY_AARCH64_FEATURE_1_AND: BTI
else()
  set(load "
.cfi_startproc
.cfi_def_cfa_offset 16
  push %rax
.cfi_adjust_cfa_offset 8
  push %rcx
.cfi_adjust_cfa_offset 8
  push %rdx
.cfi_adjust_cfa_offset 8
  push %rsi
.cfi_adjust_cfa_offset 8
  push %rdi
.cfi_adjust_cfa_offset 8
  push %r8
.cfi_adjust_cfa_offset 8
  push %r9
.cfi_adjust_cfa_offset 8
  push %r10
.cfi_adjust_cfa_offset 8
  sub $128, %rsp
.cfi_adjust_cfa_offset 128
  movups %xmm0, (%rsp)
  movups %xmm1, 16(%rsp)
  movups %xmm2, 32(%rsp)
  movups %xmm3, 48(%rsp)
  movups %xmm4, 64(%rsp)
  movups %xmm5, 80(%rsp)
  movups %xmm6, 96(%rsp)
  movups %xmm7, 112(%rsp)
  lea ${library}(%rip), %rdi
  mov 192(%rsp), %rsi
  call rtsg_first_call@PLT
  mov %rax, %r11
  movups (%rsp), %xmm0
  movups 16(%rsp), %xmm1
  movups 32(%rsp), %xmm2
  movups 48(%rsp), %xmm3
  movups 64(%rsp), %xmm4
  movups 80(%rsp), %xmm5
  movups 96(%rsp), %xmm6
  movups 112(%rsp), %xmm7
  add $128, %rsp
.cfi_adjust_cfa_offset -128
  pop %r10
.cfi_adjust_cfa_offset -8
  pop %r9
.cfi_adjust_cfa_offset -8
  pop %r8
.cfi_adjust_cfa_offset -8
  pop %rdi
.cfi_adjust_cfa_offset -8
  pop %rsi
.cfi_adjust_cfa_offset -8
  pop %rdx
.cfi_adjust_cfa_offset -8
  pop %rcx
.cfi_adjust_cfa_offset -8
  pop %rax
.cfi_adjust_cfa_offset -8
  add $8, %rsp
.cfi_adjust_cfa_offset -8
  jmp *%r11
.cfi_endproc
")
  set(property "0xc0000002, 4, 3, 0")  # GNU_PROPERTY_X86_FEATURE_1_AND: IBT, SHSTK
endif()

set(note ".section .note.gnu.property, \"a\"
.balign 8
.long 4, 16, 5
.asciz \"GNU\"
.long ${property}
.section .note.GNU-stack, \"\", %progbits
")
file(WRITE "${STUBS}" "/* Made by cmake/delay_load.cmake. */
.text
${stubs}${firsts}.Lload:${load}
.data
.balign 16
.globl ${slots}
.hidden ${slots}
${slots}:
${entries}
.bss
${copies}${note}")
file(WRITE "${TABLE}" "/* Made by cmake/delay_load.cmake. */
.section .data.rel.ro, \"aw\"
.balign 8
.globl ${table}
.type ${table}, %object
${table}:
${addresses}.size ${table}, .-${table}
${note}")
set(values "nullptr, 0")
if(copied)
  string(APPEND declared "namespace {\nconst rtsg::DelayedLibrary::Data kCopies[] = {\n${rows}};\n}  // namespace\n\n")
  set(values "kCopies, ${copied}")
endif()
file(WRITE "${LIBRARY}" "${opening}extern \"C\" [[gnu::visibility(\"hidden\")]] void* ${slots}[];
${declared}${namespace}{{\"rtsg_${NAME}\", \"${table}\", \"${NEED}\", ${slots}, ${count}, ${values}}};
}  // namespace rtsg::delayed
")
