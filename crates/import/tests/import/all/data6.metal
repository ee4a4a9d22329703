// Metal
