/*
 * short.c - a fuzz target without libFuzzer: every file of a corpus as it is, then so many mutations
 * of them, always the same ones.  fuzz_x CORPUS [MUTATIONS]
 */
#include "fuzz.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SIZE_MAX_ = 1 << 16, FILES_MAX = 4096 };

static struct {
    uint8_t *bytes;
    size_t size;
} corpus[FILES_MAX];
static size_t files;
static uint64_t state = 1;

static size_t below(size_t n)
{
    state = state * 6364136223846793005u + 1442695040888963407u;
    return n ? (size_t)(state >> 33) % n : 0;
}

static void load(const char *directory)
{
    DIR *dir = opendir(directory);
    for (struct dirent *e; dir && files < FILES_MAX && (e = readdir(dir));) {
        char path[4096];
        if (*e->d_name == '.') continue;
        snprintf(path, sizeof path, "%s/%s", directory, e->d_name);
        FILE *f = fopen(path, "rb");
        uint8_t *bytes = f ? malloc(SIZE_MAX_) : NULL;
        if (bytes) {
            corpus[files].size = fread(bytes, 1, SIZE_MAX_, f);
            corpus[files++].bytes = bytes;
        }
        if (f) fclose(f);
    }
    if (dir) closedir(dir);
}

/* In a buffer of exactly its size, so that the sanitizer sees a byte too many. */
static void try(const uint8_t *bytes, size_t size)
{
    uint8_t *exact = malloc(size ? size : 1);
    if (!exact) exit(2);
    memcpy(exact, bytes, size);
    LLVMFuzzerTestOneInput(exact, size);
    free(exact);
}

static size_t mutate(uint8_t *bytes, size_t size)
{
    static const char words[] = "{}[]\",:0123456789.-+eE \\nullb\r\n\0\xff";
    size_t at = below(size), other = below(files), n = below(16);
    switch (below(6)) {
    case 0: bytes[at] = (uint8_t)below(256); return size;
    case 1: bytes[at] = (uint8_t)words[below(sizeof words)]; return size;
    case 2: /* cut */ return below(8) ? size : at;
    case 3: /* remove some */
        if (n > size - at) n = size - at;
        memmove(bytes + at, bytes + at + n, size - at - n);
        return size - n;
    case 4: /* repeat some */
        if (n > size - at) n = size - at;
        if (size + n > SIZE_MAX_) return size;
        memmove(bytes + at + n, bytes + at, size - at);
        return size + n;
    default: /* some of another file */
        n = below(64);
        if (n > corpus[other].size || n > size - at) return size;
        memcpy(bytes + at, corpus[other].bytes + below(corpus[other].size - n), n);
        return size;
    }
}

int main(int argc, char **argv)
{
    static uint8_t bytes[SIZE_MAX_];
    long mutations = argc > 2 ? atol(argv[2]) : 20000;
    const char *name = strrchr(argv[0], '/');
    if (argc > 1) load(argv[1]);
    if (!files) {
        printf("FAIL %s: no corpus\n", name ? name + 1 : argv[0]);
        return 1;
    }
    for (size_t i = 0; i < files; i++) try(corpus[i].bytes, corpus[i].size);
    for (long i = 0; i < mutations; i++) {
        size_t which = below(files), size = corpus[which].size;
        memcpy(bytes, corpus[which].bytes, size);
        for (size_t k = 1 + below(4); k && size; k--) size = mutate(bytes, size);
        try(bytes, size);
    }
    printf("ok %s corpus=%zu mutations=%ld\n", name ? name + 1 : argv[0], files, mutations);
    for (size_t i = 0; i < files; i++) free(corpus[i].bytes);
    return 0;
}
