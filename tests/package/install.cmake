# Installs the build tree TREE: all of it into PREFIX/all, and each of COMPONENTS with linalg, on which
# they all stand, into a prefix of its own. SPDX-License-Identifier: BSD-3-Clause
file(REMOVE_RECURSE ${PREFIX})

function(install_tree prefix)
  execute_process(COMMAND ${CMAKE_COMMAND} --install ${TREE} --prefix ${prefix} ${ARGN}
    RESULT_VARIABLE failed OUTPUT_VARIABLE text ERROR_VARIABLE text)
  if(failed)
    message(FATAL_ERROR "Installation into ${prefix} failed:\n${text}")
  endif()
endfunction()

install_tree(${PREFIX}/all)
foreach(component IN LISTS COMPONENTS)
  install_tree(${PREFIX}/${component} --component linalg)
  install_tree(${PREFIX}/${component} --component ${component})
  file(GLOB_RECURSE files RELATIVE ${PREFIX}/${component} ${PREFIX}/${component}/*)
  foreach(library IN LISTS COMPONENTS)
    if(NOT library MATCHES "^(linalg|${component})$" AND files MATCHES "${library}")
      message(FATAL_ERROR "Component ${component} brings files of ${library}: ${files}")
    endif()
  endforeach()
endforeach()
