/* compress.h - answers compressed where the client asks and it pays. */
#ifndef API_COMPRESS_H
#define API_COMPRESS_H

#include "api.h"

/*
 * Replaces the body by its zstd (RFC 8878) or gzip (RFC 1952) and adds Content-Encoding where
 * accept_encoding (NULL: none) takes one, zstd where it names both alike; JSON of 1 KiB to 1 MiB only:
 * smaller costs more than it saves, and an array of numbers shrinks less as text (2 times, at 100 ns a number) than as a float32 (2.5 times, at 1 ns).
 * Without memory the answer stays as it is.  libdeflate, which EXR maps need anyway, packs JSON twice to
 * five times as fast as zlib and a little smaller; zstd takes 30 % to 40 % less time again, and is 1 % to
 * 8 % smaller.
 */
void api_compress(const char *accept_encoding, struct api_response *response);

#endif
