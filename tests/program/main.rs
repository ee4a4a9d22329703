//! The program as scripts and readers use it: its command line, pictures, pages, accuracy targets.

mod accuracy;
mod attila;
mod cli;
mod commands;
mod compare;
mod draws;
mod floors;
mod gl;
mod gl_arrays;
mod gl_buffers;
mod gl_features;
mod gl_later;
mod gl_lists;
mod gl_programs;
mod gl_rest;
mod gl_shaders;
mod images;
mod notebook;
mod pages;
mod recorded_scenes;
mod report;
mod scenes;
mod sweep;
mod timeline;
mod why;
mod workloads;
