# find_package(mrfgs) defines mrfgs::mrfgs, the shared library, and mrfgs::static.
get_filename_component(_mrfgs_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
if(NOT TARGET mrfgs::mrfgs)
    add_library(mrfgs::mrfgs SHARED IMPORTED)
    set_target_properties(mrfgs::mrfgs PROPERTIES
        IMPORTED_LOCATION "${_mrfgs_prefix}/lib/libmrfgs.so.@VERSION@"
        IMPORTED_SONAME "libmrfgs.so.@ABI@"
        INTERFACE_INCLUDE_DIRECTORIES "${_mrfgs_prefix}/include")
    add_library(mrfgs::static STATIC IMPORTED)
    set_target_properties(mrfgs::static PROPERTIES
        IMPORTED_LOCATION "${_mrfgs_prefix}/lib/libmrfgs.a"
        INTERFACE_LINK_LIBRARIES "@SYSTEM_LIBS@"
        INTERFACE_INCLUDE_DIRECTORIES "${_mrfgs_prefix}/include")
endif()
unset(_mrfgs_prefix)
