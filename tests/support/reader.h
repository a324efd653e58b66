/* reader.h - a measurement in bytes, through the reader of its format. */
#ifndef READER_H
#define READER_H

#include "measurement.h"

struct reader {
    struct arena arena;
    struct problem problem;
    struct measurement m;
};

/* format: of api/measurement.h, -1 to find out; to be closed, whatever it says. */
bool reader_open(struct reader *o, const void *bytes, size_t size, int format);
void reader_close(struct reader *o);

void reader_direction(double theta, double phi, double v[3]);

/* f_r of one pair; whether the measurement says anything there. */
bool reader_ask(const facet_fit_source *source, const double i[3], const double o[3],
                double rgb[3]);

/* Checks that it is a 422 whose detail has these words. */
void reader_refuses(const void *bytes, size_t size, int format, const char *says);

#endif
