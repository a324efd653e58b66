#include "log.h"

#include "metrics.h"

#include <errno.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { BUFFER_SIZE = 65536, LINE_MAX_BYTES = 2048 };

static struct {
    pthread_mutex_t mutex;
    bool events, requests;
    size_t used;
    unsigned long lost; /* bytes that stderr did not take */
    char buffer[BUFFER_SIZE];
} sink = {.mutex = PTHREAD_MUTEX_INITIALIZER};

void log_open(const char *level)
{
    sink.requests = !strcmp(level, "requests");
    sink.events = sink.requests || !strcmp(level, "events");
}

bool log_requests(void)
{
    return sink.requests;
}

/* With the mutex held. */
static void flush(void)
{
    size_t done = 0;
    while (done < sink.used) {
        ssize_t n = write(STDERR_FILENO, sink.buffer + done, sink.used - done);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) {
            sink.lost += sink.used - done; /* nowhere left to complain but the next line */
            metrics_add(METRIC_LOG_LOST_BYTES, (long long)(sink.used - done));
            break;
        }
        done += (size_t)n;
    }
    sink.used = 0;
}

void log_flush(void)
{
    pthread_mutex_lock(&sink.mutex);
    flush();
    pthread_mutex_unlock(&sink.mutex);
}

/* With the mutex held. */
static size_t put_time(char *to, size_t size)
{
    static char date[40]; /* of that second: a busy daemon writes thousands of lines in each */
    static time_t second = -1;
    static size_t n;
    struct timespec now;
    struct tm utc;
    clock_gettime(CLOCK_REALTIME, &now);
    if (now.tv_sec != second) {
        if (!gmtime_r(&now.tv_sec, &utc)) return 0;
        n = strftime(date, sizeof date, "time=%Y-%m-%dT%H:%M:%S", &utc);
        second = now.tv_sec;
    }
    memcpy(to, date, n);
    int more = snprintf(to + n, size - n, ".%03ldZ ", now.tv_nsec / 1000000);
    return more < 0 ? n : n + (size_t)more;
}

static void append(const char *line, size_t size)
{
    if (sink.used + size > BUFFER_SIZE) flush();
    memcpy(sink.buffer + sink.used, line, size); /* size <= LINE_MAX_BYTES < BUFFER_SIZE */
    sink.used += size;
}

static size_t put_lost(char *to, size_t size)
{
    if (!sink.lost) return 0;
    int more = snprintf(to, size, "log_bytes_lost=%lu ", sink.lost);
    sink.lost = 0;
    return more > 0 ? (size_t)more : 0;
}

void log_line(const char *format, ...)
{
    if (!sink.events) return;
    char line[LINE_MAX_BYTES];
    pthread_mutex_lock(&sink.mutex);
    size_t n = put_time(line, sizeof line);
    n += put_lost(line + n, sizeof line - n);
    va_list list;
    va_start(list, format);
    int more = vsnprintf(line + n, sizeof line - n, format, list);
    va_end(list);
    if (more > 0) n += (size_t)more;
    if (n > sizeof line - 1) n = sizeof line - 1; /* cut, the newline still fits */
    line[n++] = '\n';
    append(line, n);
    pthread_mutex_unlock(&sink.mutex);
}

const char *log_quote(const char *text, char *buffer, unsigned long size)
{
    enum { ESCAPED = 4 }; /* \xNN */
    size_t n = 0;
    buffer[n++] = '"';
    for (; text && *text && n + ESCAPED + 2 <= size; text++) {
        unsigned char c = (unsigned char)*text;
        if (c < 0x20 || c > 0x7e || c == '"' || c == '\\')
            n += (size_t)snprintf(buffer + n, ESCAPED + 1, "\\x%02x", c);
        else
            buffer[n++] = (char)c;
    }
    buffer[n++] = '"';
    buffer[n] = 0;
    return buffer;
}
