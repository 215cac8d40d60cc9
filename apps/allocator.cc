// SPDX-License-Identifier: Apache-2.0
//
// Pictures and matrices of megabytes come and go all the time. From the
// system's allocator they cost a tenth of a fit in page faults. jemalloc reads
// this at start-up: huge pages (thp), freed memory is kept a minute for the
// next picture (decay), for large ones too (oversize), and each thread keeps
// its own up to a megabyte (tcache). The environment variable MALLOC_CONF is
// read after it.
extern "C" {
extern const char* malloc_conf;
const char* malloc_conf =
    "thp:always,dirty_decay_ms:60000,oversize_threshold:0,"
    "tcache_max:1048576";
}
