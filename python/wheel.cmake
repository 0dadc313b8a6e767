# Packs the built package as a wheel: cmake -DPACKAGE= -DPYTHON= -DVERSION= -DOUT= -P wheel.cmake
# SPDX-License-Identifier: BSD-3-Clause
set(stage ${OUT}/stage)
file(REMOVE_RECURSE ${stage})
file(GLOB parts ${PACKAGE}/*.py ${PACKAGE}/_tether.*)
file(COPY ${parts} DESTINATION ${stage}/tether)
set(info ${stage}/tether-${VERSION}.dist-info)
execute_process(COMMAND ${PYTHON} -c
  "import sys, sysconfig as s; v = 'cp%d%d' % sys.version_info[:2]; print(v + '-' + v + '-' + s.get_platform().replace('-', '_').replace('.', '_'))"
  OUTPUT_VARIABLE tag OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
file(WRITE ${info}/WHEEL "Wheel-Version: 1.0\nGenerator: tether\nRoot-Is-Purelib: false\nTag: ${tag}\n")
file(READ ${CMAKE_CURRENT_LIST_DIR}/README.md readme)
file(WRITE ${info}/METADATA "Metadata-Version: 2.1\nName: tether\nVersion: ${VERSION}\n"
  "Summary: Keeps a computed motion on the constraints that it must obey\nLicense: BSD-3-Clause\n"
  "Requires-Python: >=3.9\nRequires-Dist: numpy\nDescription-Content-Type: text/markdown\n\n${readme}")
file(COPY ${CMAKE_CURRENT_LIST_DIR}/../LICENSE DESTINATION ${info})
execute_process(COMMAND ${PYTHON} -m wheel pack -d ${OUT} ${stage} COMMAND_ERROR_IS_FATAL ANY)
